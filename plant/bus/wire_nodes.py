"""Drives and clients at their nodes of a wire, and the faults of the drives' CAN controllers.

silent      alone on a wire of its own; what it would say is lost, as what it had queued
cut off     the drives of a robot are together on a wire of their own: they acknowledge each
other, and no client hears them; a client that is then alone on its wire is not
acknowledged, its error counter climbs to passive, its queue fills
bus-off     as by its error counters; `bus.drive_restart_s` later it begins to recover
babbling    frames of its own in its mailboxes, before what it has to say
"""

from collections.abc import Sequence

from bridge.drives.interface import DriveNode
from bridge.frame import Frame
from bridge.wire.confinement import BUS_OFF
from bridge.wire.node import Node
from bridge.wire.wire import Wire
from plant.disturbance import Disturbance
from plant.robot import EmulatedRobot


class WireDrive:
    """A drive at its node of the wire."""

    __slots__ = (
        *("apart", "backlog", "drive", "due_ns", "latest_ns", "looks_ns", "node", "robot"),
        *("silent", "soonest_ns"),
    )

    def __init__(self, robot: EmulatedRobot, drive: DriveNode, node: Node) -> None:
        self.robot = robot
        self.drive = drive
        self.node = node
        # Firmware looks at a frame that late after its end at the soonest, and at the latest.
        self.soonest_ns, self.latest_ns = robot.brief.drive.command_latency_ns
        self.due_ns = 0
        self.looks_ns = 0  # when firmware looks at the last frame that came for it
        self.backlog: dict[int, Frame] = {}  # by identifier, waiting for a mailbox
        self.silent = False  # by a fault: its controller says and hears nothing
        self.apart = False  # silent, or cut off from the clients


class WireHost:
    """A client at its node of the wire, and the credit of its transmit queue."""

    __slots__ = ("freed", "node", "submitted")

    def __init__(self, node: Node) -> None:
        self.node = node
        self.submitted = 0
        self.freed = 0  # frames that have left the queue, as the client was told

    def newly_freed(self) -> int:
        """Frames that have left the queue since the last call, sent or lost."""
        more = self.submitted - len(self.node.queue.entries) - self.freed
        if more <= 0:
            return 0
        self.freed += more
        return more


def has_to_send(drive: WireDrive) -> bool:
    """Whether frames of a drive are waiting that it can send."""
    node = drive.node
    return bool(node.queue.entries or drive.backlog) and node.state is not BUS_OFF


def disturb(wire: Wire, drives: Sequence[WireDrive], disturbance: Disturbance) -> None:
    """Let a disturbance act on the drives of a wire, and on its frames, from now on."""
    for robot in dict.fromkeys(drive.robot for drive in drives):
        of_robot = [drive for drive in drives if drive.robot is robot]
        _place(wire, of_robot, disturbance)
    babbling = {id(drive): (frame, ns) for drive, frame, ns in disturbance.babbling}
    for drive in drives:
        if (found := babbling.get(id(drive.drive))) is None or drive.silent:
            wire.quieten(drive.node)
        else:
            wire.babble(drive.node, *found)
        if any(drive.drive is failing for failing in disturbance.bus_off):
            wire.fail(drive.node)
    wire.faults.replace(disturbance.frames)
    wire.revise()


def _place(wire: Wire, drives: Sequence[WireDrive], disturbance: Disturbance) -> None:
    """Move the drives of one robot to the wire on which they are: silent, cut off, or neither."""
    cut = any(robot is drives[0].robot for robot in disturbance.cut)
    silent = [any(one is drive.drive for one in disturbance.silent) for drive in drives]
    before = [(drive.silent, drive.apart) for drive in drives]
    if before == [(one, one or cut) for one in silent]:
        return
    for drive, now in zip(drives, silent, strict=True):
        if drive.silent or now:
            wire.discard(drive.node)
            drive.backlog.clear()
        drive.silent, drive.apart = now, now or cut
        wire.reconnect(drive.node)
    for drive in drives:
        if drive.silent:
            wire.disconnect(drive.node)
    if cut:
        wire.disconnect(*(drive.node for drive in drives if not drive.silent))
