"""Tolerance of a controller for errors of its CAN interface in real time.

    error                                    Fleetloop interface   any other interface
    transmit queue full (ENOBUFS)            tolerated             tolerated
    any other, e.g. network down (ENETDOWN)  the bus is lost       tolerated for `bus_error_limit`

Tolerated means: the frames of that period are lost, the robot stops once sending has failed for
`TOLERATED_NS`, and may arm again when it succeeds. A full queue alone is tolerated without limit:
the cable may still be plugged in.
"""

import errno

import can

from configs.errors import InfrastructureError, PeerLostError

TOLERATED_NS = 50_000_000
"""Equal to the age limit of encoder frames; half of the drives' watchdog."""


class BusHealth:
    """Errors of the sends and receptions of one bus."""

    __slots__ = ("_lasting_ns", "_limit_ns", "_robot", "errors", "since_ns", "text", "unsent")

    def __init__(self, robot: str, limit_ns: int) -> None:
        self._robot = robot
        self._limit_ns = limit_ns
        self.errors = 0
        self.unsent = 0
        """Periods whose frames found the transmit queue full."""
        self.text = ""
        self.since_ns: int | None = None
        """Monotonic time since which no send succeeded, None while sends succeed."""
        self._lasting_ns: int | None = None

    def failed(self, error: Exception, now_ns: int) -> None:
        """Count an error of the bus.

        Raises:
            PeerLostError: a Fleetloop bus closed.
            InfrastructureError: the bus has failed for longer than its limit.
        """
        if isinstance(error, can.CanError):
            code = error.error_code
        else:
            code = getattr(error, "errno", None)
        self.text = f"bus error: {error}"
        if self.since_ns is None:
            self.since_ns = now_ns
        if code == errno.ENOBUFS:
            self.unsent += 1
            return
        self.errors += 1
        if not self._limit_ns:
            raise PeerLostError(f"{self._robot}: lost its bus: {error}") from error
        if self._lasting_ns is None:
            self._lasting_ns = now_ns
        failing_ns = now_ns - self._lasting_ns
        if failing_ns > self._limit_ns:
            raise InfrastructureError(
                f"{self._robot}: gave up its bus after {failing_ns * 1e-9:.1f} s of errors: {error}"
            ) from error

    def sent(self) -> None:
        """Reset after all frames of a period were sent."""
        self.since_ns = self._lasting_ns = None

    def fault(self, now_ns: int) -> str | None:
        """The fault of this bus that forbids driving the wheels, None if there is none."""
        if self.since_ns is None or now_ns - self.since_ns < TOLERATED_NS:
            return None
        return self.text
