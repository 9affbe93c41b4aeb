"""Real time against a bare UDP exchange of the same shape, in turn within one run.

Bare UDP: N processes on absolute timers, SCHED_FIFO if permitted, phases staggered; each sends 2
doubles to a plant process, which answers at once with 4, and 3 doubles to its ring neighbour. No
law, no CAN, no record. A miss is a tick without feedback when the next one is due.

Not measured: other loads on the machine, a kernel made for real time.
"""

import os
import select
import socket
import statistics
import struct
import tempfile
import time

from common import arguments, fleet, interleaved, machine, run, table

TORQUE, ENCODER = struct.Struct("<2d"), struct.Struct("<4d")


def bare_udp(n: int, hz: float, seconds: float) -> dict[str, float]:
    """Misses [%], round trip p50 and p99 [µs], processor time [% of one core]."""
    plant = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    plant.bind(("127.0.0.1", 0))
    robots = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(n)]
    for robot in robots:
        robot.bind(("127.0.0.1", 0))
    places = [robot.getsockname() for robot in robots]
    start = time.monotonic() + 0.5
    pipes = []
    server = os.fork()
    if server == 0:
        _answer(plant)
    for k, robot in enumerate(robots):
        ours, theirs = os.pipe()
        if os.fork() == 0:
            first = start + k / (n * hz)
            _control(robot, plant.getsockname(), places[(k + 1) % n], first, hz, seconds, theirs)
        os.close(theirs)
        pipes.append(ours)
    trips: list[float] = []
    misses, cpu = 0, 0.0
    for pipe in pipes:
        with os.fdopen(pipe, "rb") as stream:
            data = stream.read()
        missed, spent = struct.unpack_from("<qd", data)
        misses, cpu = misses + missed, cpu + spent
        trips += struct.unpack_from(f"<{(len(data) - 16) // 8}d", data, 16)
    plant.sendto(b"", plant.getsockname())
    for _ in range(n + 1):
        _, _, usage = os.wait3(0)
        cpu += usage.ru_utime + usage.ru_stime
    for opened in (plant, *robots):
        opened.close()
    trips.sort()
    return {
        "misses": 100.0 * misses / (n * hz * seconds),
        "p50": trips[len(trips) // 2] * 1e6,
        "p99": trips[int(len(trips) * 0.99)] * 1e6,
        "cpu": 100.0 * cpu / seconds,
    }


def _fifo() -> None:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
    except OSError:
        return


def _answer(plant: socket.socket) -> None:
    _fifo()
    while True:
        data, sender = plant.recvfrom(64)
        if not data:
            os._exit(0)
        right, left = TORQUE.unpack(data)
        plant.sendto(ENCODER.pack(right, left, 0.0, 0.0), sender)


def _control(
    mine: socket.socket,
    plant: tuple[str, int],
    neighbour: tuple[str, int],
    start: float,
    hz: float,
    seconds: float,
    result: int,
) -> None:
    _fifo()
    trips, misses, sent = [], 0, 0.0
    for k in range(int(hz * seconds) + 1):
        due = start + k / hz
        while (left := due - time.monotonic()) > 0:
            if select.select([mine], [], [], left)[0] and len(mine.recv(64)) == ENCODER.size:
                if sent:
                    trips.append(time.monotonic() - sent)
                sent = 0.0
        misses += bool(sent)
        mine.sendto(TORQUE.pack(0.1, 0.1), plant)
        sent = time.monotonic()
        mine.sendto(struct.pack("<3d", 1.0, 2.0, 3.0), neighbour)
    with os.fdopen(result, "wb") as stream:
        stream.write(struct.pack("<qd", misses, 0.0) + struct.pack(f"<{len(trips)}d", *trips))
    os._exit(0)


def fleetloop(scenario: str, seconds: float) -> dict[str, float]:
    """The same of a run in real time."""
    kept = run(scenario, "--duration", str(seconds))["realtime"]
    return {
        "misses": kept["miss_percent"],
        "p50": kept["round_trip_us"]["p50"],
        "p99": kept["round_trip_us"]["p99"],
        "cpu": kept["cpu_percent_of_one_core"],
    }


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
            kept: dict[str, list[dict[str, float]]] = {"bare UDP": [], "Fleetloop": []}

            def udp(n: int = n, hz: float = hz, kept: dict = kept) -> float:
                kept["bare UDP"].append(bare_udp(n, hz, seconds))
                return kept["bare UDP"][-1]["misses"]

            def ours(scenario: str = scenario, kept: dict = kept) -> float:
                kept["Fleetloop"].append(fleetloop(scenario, seconds))
                return kept["Fleetloop"][-1]["misses"]

            interleaved(rounds, {"misses %, bare UDP": udp, "misses %, Fleetloop": ours})
            for name, values in kept.items():
                middle = {key: statistics.median(v[key] for v in values) for key in values[0]}
                rows.append(
                    (
                        f"{n} × {hz:g} Hz",
                        name,
                        f"{middle['misses']:.3f}",
                        f"{middle['p50']:.0f}",
                        f"{middle['p99']:.0f}",
                        f"{middle['cpu']:.0f}",
                    )
                )
    header = ("", "", "misses %", "round trip p50 µs", "p99 µs", "CPU % of one core")
    table(header, rows)


if __name__ == "__main__":
    main()
