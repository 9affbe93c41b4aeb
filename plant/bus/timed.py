"""A bus with bit timing: a frame takes its bits, and acts when it arrives.

    event                       at                       what happens
    a drive has something due   its own time             its frames go to its mailboxes
    a frame ends                by the wire              all clients hear it; a host's is on its way
                                                         to the drives' firmware
    a frame is destroyed        by the wire              all clients hear an error frame
    firmware looks at it        a latency after its end  the drive acts; replies go to its mailboxes
    a robot's drives have sent  with their last frame    its controller is asked; its answer goes to
    all of the tick                                      its transmit queue then
    the tick is over            start of the next one    controllers that were not asked yet are
                                                         asked with what there is

The last two are lockstep's alone. A client joins the wire with the first frame that it sends: one
that only listens is no node, and changes nothing. An error frame from a client is an error flag on
order (`wire`). Bodies move from event to event. A drive's frame that finds no free mailbox waits
for one, the newest of its identifier; a client's that finds no place in its transmit queue is
refused and counted.
"""

from collections.abc import Sequence
from heapq import heappop, heappush
from random import Random

from bridge.can_bus.packet import Key, Submitted, Transmitted
from bridge.drives.interface import DriveNode
from bridge.frame import Frame
from bridge.network.telemetry import FROM_DRIVE, Tap
from bridge.wire.confinement import NodeState
from bridge.wire.error_frames import of_error, of_state
from bridge.wire.node import Delivered, ErrorFrame, Node, StateChanged
from bridge.wire.queues import Fifo, Mailboxes
from bridge.wire.wire import Wire
from configs.brief import Schedule, WireModel
from plant.bus.port import Begin, Port, Steps
from plant.faults import BusFaults
from plant.robot import EmulatedRobot

_NEVER = 1 << 62


class _Drive:
    """A drive at its node of the wire."""

    __slots__ = ("backlog", "drive", "due_ns", "looks_ns", "node", "robot")

    def __init__(self, robot: EmulatedRobot, drive: DriveNode, node: Node) -> None:
        self.robot = robot
        self.drive = drive
        self.node = node
        self.due_ns = 0
        self.looks_ns = 0  # when firmware looks at the last frame that came for it
        self.backlog: dict[int, Frame] = {}  # by identifier, waiting for a mailbox


class TimedBus:
    """The robots of one bus, their drives, and the wire between these and all clients."""

    def __init__(
        self,
        robots: Sequence[EmulatedRobot],
        schedule: Schedule,
        model: WireModel,
        substeps: int,
        *,
        port: Port,
        begin: Begin,
        tap: Tap,
        random: Random,
        faults: BusFaults,
    ) -> None:
        self.faults = faults
        self._tap = tap
        self._port = port
        self.robots = robots
        self.acts_between_ticks = True
        self.wire = Wire(model.bitrate_bit_s)
        self._model = model
        self._schedule = schedule
        self._zero_ns = schedule.bus_time_ns(0)
        self._step_ns = schedule.period_ns // substeps
        self._begin = begin
        self._random = random
        self._drives = [
            _Drive(robot, drive, self._drive_node(f"{robot.brief.robot} {side}"))
            for robot in robots
            for side, drive in zip(("right", "left"), robot.drives, strict=True)
        ]
        self._of_robot = {
            robot.brief.robot: [drive for drive in self._drives if drive.robot is robot]
            for robot in robots
        }
        self._of_node = {drive.node: drive for drive in self._drives}
        self._hosts: dict[Key, Node] = {}
        self._key_of: dict[Node, Key] = {}
        self._states: dict[Node, NodeState] = {}
        for robot in robots:
            self._host(robot.brief.robot)
        self._mail: list[tuple[int, int, _Drive, Frame]] = []
        self._number = 0
        self._now_ns = 0
        self._transmitted: list[Transmitted] = []
        self._freed: list[tuple[Key, int]] = []
        self.crossed = 0
        """Frames that ended on the wire, drives' and clients'."""

    def node_counts(self) -> dict[str, dict[str, int]]:
        """Frames of each drive and of each client that is still there, by their fate."""
        nodes = (*(drive.node for drive in self._drives), *self._hosts.values())
        return {node.name: node.counters.as_dict() for node in nodes}

    # --- lockstep --------------------------------------------------------------------------------

    def steps(self) -> Steps:
        """The ticks from the first of the countdown to the closing one."""
        schedule = self._schedule
        for tick in range(-schedule.countdown_ticks, schedule.ticks + 1):
            start_ns = schedule.bus_time_ns(tick)
            end_ns = start_ns + schedule.period_ns
            self._move(start_ns)
            self.faults.begin(tick)
            self._begin(tick)
            waiting = [robot.brief.robot for robot in self.robots]
            self._step(start_ns)
            while waiting:
                asked = self._run_to_question(end_ns, waiting)
                if asked is None:
                    asked = waiting[0]
                waiting.remove(asked)
                yield self._ask(asked)
                self._process_answer()
            self._run(end_ns)
            yield None

    def _ask(self, robot: str) -> str:
        """Put a question to the clients."""
        self._return_credit()
        transmitted, self._transmitted = self._transmitted, []
        self._port.forward(self._now_ns, transmitted, robot)
        return robot

    def _process_answer(self) -> None:
        for key in self._port.departed():
            self._detach(key)
        self.submit(self._port.submitted())

    # --- real time -------------------------------------------------------------------------------

    def next_ns(self) -> int:
        """The next bus time at which a frame ends or a drive acts."""
        return self._next_ns()

    def react(self, now_ns: int) -> None:
        """Submit the clients' frames to the wire."""
        self.advance(now_ns)
        self._process_answer()

    def advance(self, now_ns: int) -> None:
        """Let everything happen through this instant, or through the last one if that is later."""
        self._run(max(now_ns, self._now_ns) + 1)
        self._move(self._now_ns)
        self._return_credit()
        transmitted, self._transmitted = self._transmitted, []
        if transmitted:
            self._port.forward(self._now_ns, transmitted, None)

    def move(self, bus_ns: int) -> None:
        """Move the bodies to a tick, and everything on the wire with them."""
        self.advance(bus_ns)

    def send_due(self, bus_ns: int) -> None:
        """The drives send what is due when it is due."""

    # --- both ------------------------------------------------------------------------------------

    def submit(self, submitted: Sequence[Submitted]) -> None:
        """Put frames of clients into their transmit queues now."""
        refused: dict[Key, int] = {}
        for key, frame in submitted:
            node = self._hosts.get(key) or self._host(key)
            if not self.wire.submit(node, frame, self._now_ns):
                refused[key] = refused.get(key, 0) + 1
        self._freed += refused.items()

    def _detach(self, key: Key) -> None:
        """A client has left."""
        node = self._hosts.pop(key, None)
        if node is not None:
            del self._key_of[node]
            self.wire.detach(node)

    def _return_credit(self) -> None:
        freed, self._freed = self._freed, []
        for key, count in freed:
            self._port.return_credit(key, count)

    def _move(self, bus_ns: int) -> None:
        for robot in self.robots:
            robot.move(bus_ns, self._zero_ns, self._step_ns)

    def _run_to_question(self, end_ns: int, waiting: Sequence[str]) -> str | None:
        """Run until the drives of a robot have sent all of the tick; None at its end."""
        while True:
            for robot in waiting:
                if not any(d.node.queue.entries or d.backlog for d in self._of_robot[robot]):
                    return robot
            if not self._event(end_ns):
                return None

    def _run(self, end_ns: int) -> None:
        while self._event(end_ns):
            pass

    def _event(self, end_ns: int) -> bool:
        """The next event before `end_ns`; False when there is none."""
        at_ns = self._next_ns()
        if at_ns >= end_ns:
            self._step(end_ns - 1)
            return False
        self._step(at_ns)
        return True

    # --- events ----------------------------------------------------------------------------------

    def _next_ns(self) -> int:
        next_ns = self.wire.next_ns()
        at_ns = _NEVER if next_ns is None else next_ns
        if self._mail and self._mail[0][0] < at_ns:
            at_ns = self._mail[0][0]
        for drive in self._drives:
            if drive.due_ns < at_ns:
                at_ns = drive.due_ns
        return at_ns

    def _step(self, at_ns: int) -> None:
        """All that happens at an instant."""
        self._now_ns = at_ns
        for event in self.wire.advance(at_ns):
            if isinstance(event, Delivered):
                self._deliver(event)
            elif isinstance(event, ErrorFrame):
                self._note_error(event)
            else:
                self._note_state(event)
        while self._mail and self._mail[0][0] <= at_ns:
            _, _, drive, frame = heappop(self._mail)
            drive.robot.move(at_ns, self._zero_ns, self._step_ns)
            self._submit(drive, drive.drive.on_frame(frame, at_ns))
            drive.due_ns = drive.drive.next_due_ns
        for drive in self._drives:
            if drive.due_ns <= at_ns:
                drive.robot.move(at_ns, self._zero_ns, self._step_ns)
                self._submit(drive, drive.drive.due(at_ns))
                drive.due_ns = drive.drive.next_due_ns

    def _deliver(self, event: Delivered) -> None:
        end_ns, sender, frame = event.end_ns, event.sender, event.frame
        self.crossed += 1
        key = self._key_of.get(sender)
        self._transmitted.append(Transmitted(end_ns, frame, key))
        self._tap(end_ns, (frame,), FROM_DRIVE if key is None else 0)
        drive = self._of_node.get(sender)
        if drive is not None:
            if drive.backlog:
                waiting = list(drive.backlog.values())
                drive.backlog.clear()
                self._submit(drive, waiting)
            return
        if key is not None:
            self._freed.append((key, 1))
        can_id = frame.can_id
        # A set-point concerns only the drive at its address.
        concerned = [d for d in self._drives if d.drive.setpoint_id == can_id] or self._drives
        for target in concerned:
            if target.node in event.heard_by:
                soonest_ns, latest_ns = target.robot.brief.drive.command_latency_ns
                latency_ns = soonest_ns
                if latest_ns > soonest_ns:
                    latency_ns = self._random.randint(soonest_ns, latest_ns)
                # In order: firmware reads its mailbox from the front.
                target.looks_ns = max(target.looks_ns, end_ns + latency_ns)
                self._number += 1
                heappush(self._mail, (target.looks_ns, self._number, target, frame))

    def _note_error(self, event: ErrorFrame) -> None:
        apart = {key: of_error(event, node) for key, node in self._hosts.items()}
        self._transmitted.append(Transmitted(event.at_ns, of_error(event, None), apart=apart))
        self._freed += [(self._key_of[n], 1) for n in event.ordered_by if n in self._key_of]

    def _note_state(self, event: StateChanged) -> None:
        node = event.node
        key = self._key_of.get(node)
        if key is not None:
            before = self._states.get(node, NodeState.ERROR_ACTIVE)
            self._states[node] = event.state
            self._transmitted.append(Transmitted(event.at_ns, of_state(event, before), to=key))

    def _submit(self, drive: _Drive, frames: Sequence[Frame]) -> None:
        for frame in frames:
            if drive.backlog or not self.wire.submit(drive.node, frame, self._now_ns):
                drive.backlog[frame.can_id] = frame

    def _drive_node(self, name: str) -> Node:
        mailboxes = Mailboxes(self._model.tx_mailboxes)
        return self.wire.attach(name, queue=mailboxes, restart_ns=self._model.drive_restart_ns)

    def _host(self, key: Key) -> Node:
        model = self._model
        node = self.wire.attach(str(key), queue=Fifo(model.txqueuelen), restart_ns=model.restart_ns)
        self._hosts[key] = node
        self._key_of[node] = key
        return node
