"""`fleetloop can send`: put frames on a bus, in cansend's syntax.

A frame goes to all other clients and the drives of the bus, as from any node. Repeats keep absolute
deadlines of the wall clock, so the mean rate holds.
"""

from collections.abc import Sequence

import can

from bridge.can_bus.pythoncan import to_message
from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.errors import ExitStatus, InfrastructureError
from fleetloop.can import text
from fleetloop.can.client import open_bus
from fleetloop.signals import interruptible

FULL_S = 2.0
"""Longest wait for room on a full bus."""


@interruptible
def send(
    channel: str,
    frames: Sequence[str],
    *,
    count: int = 1,
    gap_s: float = 0.0,
    clock: Clock = SYSTEM_CLOCK,
) -> int:
    """Send frames in order, `count` times, a gap between them; return the exit status.

    Raises:
        ScenarioError: a text is no frame; nothing was sent.
        InfrastructureError: no such bus, or it ended.
    """
    messages = [to_message(it.can_id, it.data) for it in map(text.parse, frames)]
    with open_bus(channel) as bus:
        sent = 0
        start = clock.monotonic_s()
        try:
            for _ in range(count):
                for message in messages:
                    if gap_s and (left_s := start + sent * gap_s - clock.monotonic_s()) > 0.0:
                        clock.sleep(left_s)
                    bus.send(message, FULL_S)
                    sent += 1
        except can.CanOperationError as error:
            raise InfrastructureError(f"{error}, after {sent} frames") from error
        except KeyboardInterrupt:
            return ExitStatus.INTERRUPTED
    return ExitStatus.OK
