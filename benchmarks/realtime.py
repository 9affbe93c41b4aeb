"""Real time against a bare UDP exchange of the same shape, in turn within one run.

Bare UDP: N processes on absolute timers, with the same requests to the kernel as Fleetloop's
(SCHED_FIFO, locked memory), phases staggered; each sends 2 doubles to a plant process, which
answers at once with 4, and 3 doubles to its ring neighbour. No law, no CAN, no record.

A miss is a tick without feedback when the next one is due. Processor time is that of all processes
from the first tick to the end, so no start-up. Medians, ranges, and within the same round the
difference of misses in percentage points and the ratios of the rest.

Not measured: other loads on the machine, a kernel made for real time, real drives on a real bus.
"""

import os
import select
import socket
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial

from common import arguments, fleet, interleaved, machine, median_and_range, ratios, run, table

from bridge.process.scheduling import go_realtime

TORQUE, ENCODER, PATH_STATE = struct.Struct("<2d"), struct.Struct("<4d"), struct.Struct("<3d")
RESULT = struct.Struct("<qd")  # misses, processor time [s]; round trips [s] follow
PRIORITY = 40
LEAD_S = 0.5
SILENCE_S = 5

Result = tuple[int, float, Sequence[float]]
"""Misses, processor time [s], round trips [s]."""
Exchange = tuple[socket.socket, tuple[str, int], tuple[str, int]]
"""Own socket; where the plant and the ring neighbour are."""
Values = Sequence[dict[str, float]]


def bare_udp(n: int, hz: float, seconds: float) -> dict[str, float]:
    """Misses [%], round trip p50 and p99 [µs], processor time [% of one core]."""
    plant, *robots = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(n + 1))
    for opened in (plant, *robots):
        opened.bind(("127.0.0.1", 0))
    places = [robot.getsockname() for robot in robots]
    start = time.monotonic() + LEAD_S
    answers = _forked(partial(_answer, plant))
    controllers = []
    for k, robot in enumerate(robots):
        exchange = (robot, plant.getsockname(), places[(k + 1) % n])
        first = start + k / (n * hz)
        controllers.append(_forked(partial(_control, exchange, first, hz, seconds)))
    results = [_result(pipe) for pipe in controllers]
    plant.sendto(b"", plant.getsockname())
    results.append(_result(answers))
    for _ in results:
        os.wait()
    for opened in (plant, *robots):
        opened.close()
    trips = sorted(trip for _, _, of_one in results for trip in of_one)
    return {
        "misses": 100.0 * sum(misses for misses, _, _ in results) / (n * hz * seconds),
        "p50": trips[len(trips) // 2] * 1e6,
        "p99": trips[int(len(trips) * 0.99)] * 1e6,
        "cpu": 100.0 * sum(cpu_s for _, cpu_s, _ in results) / seconds,
    }


def _forked(body: Callable[[], Result]) -> int:
    """The end of a pipe on which the body's result comes, from a process of its own."""
    ours, theirs = os.pipe()
    if os.fork():
        os.close(theirs)
        return ours
    status = 1
    try:
        go_realtime(PRIORITY)
        misses, cpu_s, trips = body()
        with os.fdopen(theirs, "wb") as stream:
            stream.write(RESULT.pack(misses, cpu_s) + struct.pack(f"<{len(trips)}d", *trips))
        status = 0
    finally:
        os._exit(status)


def _result(pipe: int) -> Result:
    with os.fdopen(pipe, "rb") as stream:
        data = stream.read()
    if not data:
        sys.exit("a process of the bare exchange failed")
    misses, cpu_s = RESULT.unpack_from(data)
    trips = struct.unpack_from(f"<{(len(data) - RESULT.size) // 8}d", data, RESULT.size)
    return misses, cpu_s, trips


def _answer(plant: socket.socket) -> Result:
    """Until an empty message: the kernel's time-out costs the exchange no system call."""
    plant.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", SILENCE_S, 0))
    data, sender = plant.recvfrom(64)
    began = time.process_time()
    while data:
        right, left = TORQUE.unpack(data)
        plant.sendto(ENCODER.pack(right, left, 0.0, 0.0), sender)
        data, sender = plant.recvfrom(64)
    return 0, time.process_time() - began, ()


def _control(exchange: Exchange, start: float, hz: float, seconds: float) -> Result:
    mine, plant, neighbour = exchange
    trips: list[float] = []
    misses, sent, began = 0, 0.0, 0.0
    for k in range(int(hz * seconds) + 1):
        due = start + k / hz
        while (left := due - time.monotonic()) > 0:
            if select.select([mine], [], [], left)[0] and len(mine.recv(64)) == ENCODER.size:
                if sent:
                    trips.append(time.monotonic() - sent)
                sent = 0.0
        if not k:
            began = time.process_time()
        misses += bool(sent)
        mine.sendto(TORQUE.pack(0.1, 0.1), plant)
        sent = time.monotonic()
        mine.sendto(PATH_STATE.pack(1.0, 2.0, 3.0), neighbour)
    return misses, time.process_time() - began, trips


def fleetloop(scenario: str, seconds: float) -> dict[str, float]:
    """The same of a run in real time."""
    kept = run(scenario, "--duration", str(seconds))["realtime"]
    return {
        "misses": kept["miss_percent"],
        "p50": kept["round_trip_us"]["p50"],
        "p99": kept["round_trip_us"]["p99"],
        "cpu": kept["cpu_percent_of_one_core"],
    }


def rows_of(what: str, bare: Values, ours: Values) -> list[tuple[str, ...]]:
    """Both, and ours against the bare exchange within the same round."""
    forms = {"misses": ".3f", "p50": ".0f", "p99": ".0f", "cpu": ".0f"}
    rows = []
    for name, values in (("bare UDP", bare), ("Fleetloop", ours)):
        cells = [median_and_range([v[key] for v in values], form) for key, form in forms.items()]
        rows.append((what, name, *cells))
    points = [v["misses"] - u["misses"] for u, v in zip(bare, ours, strict=True)]
    factors = [
        "× " + median_and_range(ratios([v[key] for v in ours], [u[key] for u in bare]), ".2f")
        for key in ("p50", "p99", "cpu")
    ]
    misses = f"{median_and_range(points, '+.3f')} points"
    return [*rows, (what, "Fleetloop against bare", misses, *factors)]


def main() -> None:
    """Measure and print."""
    options = arguments(__doc__)
    rounds, seconds = (1, 4.0) if options.quick else (5, 8.0)
    print(machine())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        clock = {"mode": "realtime", "control_period_s": 0.005, "countdown_s": 0.5}
        for n, hz in ((4, 1000.0), (16, 200.0)):
            scenario = "paper_realtime" if n == 4 else fleet(folder, n, seconds, **clock)
            what = f"{n} × {hz:g} Hz"
            results = interleaved(
                rounds,
                {
                    f"{what}, bare UDP": partial(bare_udp, n, hz, seconds),
                    f"{what}, Fleetloop": partial(fleetloop, scenario, seconds),
                },
            )
            rows += rows_of(what, *results.values())
    table(("", "", "misses %", "round trip p50 µs", "p99 µs", "CPU % of one core"), rows)


if __name__ == "__main__":
    main()
