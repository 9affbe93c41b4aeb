"""A complete host for two ODrives on a CAN bus: arm, ramp the torque, read the encoders, stop.

    python host.py                                      # robot r1 of `fleetloop plant`
    python host.py --interface socketcan --channel can0 --torque 0.02    # the real thing

Nothing in it is Fleetloop's: python-can and `struct`, frames of ODrive's CANSimple (firmware 0.6).
The identifier of a frame is node << 5 | command, floats are little endian, torques are the shaft's.

What a host of motors has to do, it does:

* waits for the heartbeats of both drives before anything else, and clears old errors;
* sends set-points all the time, zero ones too: the watchdog of an armed drive waits for them;
* stops both wheels if one drive reports an error, leaves closed loop, or falls silent;
* leaves the drives idle however it ends, by Ctrl-C, SIGTERM or an exception too.

Exit status: 0 all well, 1 a drive failed, 128 + its number after a signal.
"""

import argparse
import math
import signal
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import can

HEARTBEAT, SET_AXIS_STATE, ENCODER, SET_MODE = 0x01, 0x07, 0x09, 0x0B
SET_INPUT_TORQUE, CLEAR_ERRORS = 0x0E, 0x18
IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, PASSTHROUGH = 1, 1

PERIOD_S = 0.01
SILENT_S = 0.5
"""Heartbeats come every 0.1 s."""
ARMED_WITHIN_S = 2.0


class DriveError(Exception):
    """A drive is not there, reports an error or has stopped."""


@dataclass
class Axis:
    """What one drive says of itself."""

    node: int
    heard_s: float = 0.0  # of its last heartbeat; 0: none yet
    errors: int = 0
    state: int = 0
    position_rev: float = 0.0
    velocity_rev_s: float = 0.0

    def hear(self, command: int, data: bytes | bytearray, now_s: float) -> None:
        """Take a frame of this node; what is too short, or asked by others, is none."""
        if command == HEARTBEAT and len(data) >= 7:
            self.errors, self.state = struct.unpack_from("<IB", data)
            self.heard_s = now_s
        elif command == ENCODER and len(data) >= 8:
            self.position_rev, self.velocity_rev_s = struct.unpack_from("<ff", data)


class Host:
    """Both drives of a robot on a bus."""

    def __init__(self, bus: can.BusABC, nodes: tuple[int, int]) -> None:
        self.bus = bus
        self.axes = {node: Axis(node) for node in nodes}

    def say(self, command: int, data: bytes) -> None:
        """Send a command to both drives."""
        for node in self.axes:
            can_id = node << 5 | command
            self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def listen_until(self, deadline_s: float) -> None:
        """Hear what the drives say until then."""
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            message = self.bus.recv(left_s)
            if message is None or message.is_extended_id or message.is_error_frame:
                continue
            axis = self.axes.get(message.arbitration_id >> 5)
            if axis is not None and not message.is_remote_frame:
                axis.hear(message.arbitration_id & 0x1F, message.data, time.monotonic())

    def torque(self, torque_N_m: float) -> None:
        """Send a set-point to both drives, listen for a period."""
        deadline_s = time.monotonic() + PERIOD_S
        self.say(SET_INPUT_TORQUE, struct.pack("<f", torque_N_m))
        self.listen_until(deadline_s)

    def check(self) -> None:
        """Raise `DriveError` if a drive must not be driven on."""
        for axis in self.axes.values():
            if axis.errors:
                raise DriveError(f"node {axis.node}: errors 0x{axis.errors:08x}")
            if axis.state != CLOSED_LOOP:
                raise DriveError(f"node {axis.node}: left closed loop, state {axis.state}")
            if time.monotonic() - axis.heard_s > SILENT_S:
                raise DriveError(f"node {axis.node}: no heartbeat for {SILENT_S} s")

    def arm(self) -> None:
        """Wait for both drives, clear their errors, arm them at zero torque."""
        self._await(lambda axis: axis.heard_s > 0.0, "no heartbeat")
        for axis in self.axes.values():
            if axis.errors:
                print(f"node {axis.node}: clearing errors 0x{axis.errors:08x}")
        self.say(CLEAR_ERRORS, b"\0")
        self.say(SET_MODE, struct.pack("<II", TORQUE_CONTROL, PASSTHROUGH))
        self._await(lambda axis: axis.errors == 0, "errors stay")
        self.say(SET_AXIS_STATE, struct.pack("<I", CLOSED_LOOP))
        self._await(lambda axis: axis.state == CLOSED_LOOP, "does not arm")
        print("armed")

    def stop(self) -> None:
        """Zero torque, then idle; wait until both drives say so."""
        self.say(SET_INPUT_TORQUE, struct.pack("<f", 0.0))
        self.say(SET_AXIS_STATE, struct.pack("<I", IDLE))
        self._await(lambda axis: axis.state != CLOSED_LOOP, "does not become idle")
        print("idle")

    def _await(self, done: Callable[[Axis], bool], complaint: str) -> None:
        """Send zero torque until `done` holds for both, which feeds the watchdog."""
        deadline_s = time.monotonic() + ARMED_WITHIN_S
        while waiting := [axis for axis in self.axes.values() if not done(axis)]:
            if time.monotonic() > deadline_s:
                raise DriveError(
                    "; ".join(f"node {a.node}: {complaint}, errors 0x{a.errors:x}" for a in waiting)
                )
            self.torque(0.0)


def ramp(peak_N_m: float, up_s: float, hold_s: float) -> list[float]:
    """Torques, one for each period: up, hold, down."""
    steps, held = max(1, round(up_s / PERIOD_S)), round(hold_s / PERIOD_S)
    up = [peak_N_m * step / steps for step in range(1, steps + 1)]
    return [*up, *[peak_N_m] * held, *reversed(up), 0.0]


def drive(host: Host, torques: list[float]) -> None:
    """Send the torques, watch the drives, print ten times a second what the wheels do."""
    for n, torque_N_m in enumerate(torques):
        host.torque(torque_N_m)
        host.check()
        if n % 10 == 0:
            wheels = "  ".join(
                f"{a.position_rev:+8.3f} rev {a.velocity_rev_s:+7.3f} rev/s"
                for a in host.axes.values()
            )
            print(f"{n * PERIOD_S:5.2f} s  {torque_N_m:+6.3f} N·m  {wheels}")


def main() -> int:
    """Parse, open the bus, drive, leave the drives idle."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--interface", default="fleetloop", help="of python-can")
    parser.add_argument("--channel", default="r1")
    parser.add_argument("--bitrate", type=int, help="if the adapter needs one")
    parser.add_argument("--nodes", type=int, nargs=2, default=(0, 1), metavar="N")
    parser.add_argument("--torque", type=float, default=0.3, help="peak, at the shafts [N·m]")
    parser.add_argument("--seconds", type=float, default=1.0, help="at the peak")
    options = parser.parse_args()
    if not math.isfinite(options.torque) or not 0.0 <= options.seconds < math.inf:
        parser.error("--torque and --seconds are finite numbers, --seconds 0 or more")
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    settings = {} if options.bitrate is None else {"bitrate": options.bitrate}
    with can.Bus(interface=options.interface, channel=options.channel, **settings) as bus:
        host = Host(bus, tuple(options.nodes))
        try:
            host.arm()
            drive(host, ramp(options.torque, 0.5, options.seconds))
        finally:
            host.stop()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (DriveError, can.CanError) as error:  # no such bus, as well
        sys.exit(f"host.py: {error}")
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
