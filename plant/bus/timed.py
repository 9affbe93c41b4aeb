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
from bridge.frame import Frame
from bridge.network.telemetry import FROM_DRIVE, FrameBuffer
from bridge.wire.confinement import BUS_OFF, ERROR_ACTIVE, NodeState
from bridge.wire.error_frames import of_error, of_state
from bridge.wire.node import Delivered, ErrorFrame, Node, StateChanged
from bridge.wire.queues import Fifo, Mailboxes
from bridge.wire.wire import Wire
from configs.brief import Schedule, WireModel
from configs.ticks import Ticks
from plant.bus.port import Begin, Port, Steps
from plant.bus.wire_nodes import WireDrive, WireHost, disturb, has_to_send
from plant.disturbance import Disturbance
from plant.faults import BusFaults
from plant.robot import EmulatedRobot


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
        log: FrameBuffer | None,
        random: Random,
        faults: BusFaults,
    ) -> None:
        self.faults = faults
        self._log = log
        self._port = port
        self.robots = robots
        self.acts_between_ticks = True
        self.wire = Wire(model.bitrate_bit_s)
        self._model = model
        self._schedule = schedule
        self._ticks = Ticks(schedule)
        self._zero_ns = self._ticks.bus_time_ns(0)
        self._step_ns = schedule.period_ns // substeps
        self._begin = begin
        self._random = random
        self._drives = [
            WireDrive(robot, drive, self._drive_node(f"{robot.brief.robot} {side}"))
            for robot in robots
            for side, drive in zip(("right", "left"), robot.drives, strict=True)
        ]
        self._of_robot = {
            robot.brief.robot: [drive for drive in self._drives if drive.robot is robot]
            for robot in robots
        }
        self._of_node = {drive.node: drive for drive in self._drives}
        self._hosts: dict[Key, WireHost] = {}
        self._key_of: dict[Node, Key] = {}
        self._states: dict[Node, NodeState] = {}
        if not schedule.realtime:  # then controllers have the names of their robots
            for robot in robots:
                self._host(robot.brief.robot)
        self._mail: list[tuple[int, int, WireDrive, Frame]] = []
        self._number = 0
        self._now_ns = 0
        self._transmitted: list[Transmitted] = []
        self._stirred: dict[Key, None] = {}  # clients whose queues have changed
        faults.disturbances.disturb = self._disturb
        faults.struck = self._note_due
        self.crossed = 0
        """Frames that ended on the wire, drives' and clients'."""

    @property
    def now_ns(self) -> int:
        """The bus time of the wire."""
        return self.wire.now_ns

    @property
    def busy_ns(self) -> int:
        """Time in which the wire was occupied until then."""
        return self.wire.busy_ns

    def node_counts(self) -> dict[str, dict[str, int]]:
        """Frames of each drive and of each client that is still there, by their fate."""
        hosts = (host.node for host in self._hosts.values())
        nodes = (*(drive.node for drive in self._drives), *hosts)
        return {node.name: node.counters.as_dict() for node in nodes}

    # --- lockstep --------------------------------------------------------------------------------

    def steps(self) -> Steps:
        """The ticks from the first of the countdown to the closing one."""
        schedule, ticks = self._schedule, self._ticks
        for tick in range(-schedule.countdown_ticks, schedule.ticks + 1):
            start_ns = ticks.bus_time_ns(tick)
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
        for one in submitted:
            key, frame = one.key, one.frame
            host = self._hosts.get(key) or self._host(key)
            host.submitted += 1
            self.wire.submit(host.node, frame, self._now_ns)
            self._stirred[key] = None

    def _detach(self, key: Key) -> None:
        """A client has left."""
        host = self._hosts.pop(key, None)
        if host is not None:
            del self._key_of[host.node]
            self.wire.detach(host.node)

    def _return_credit(self) -> None:
        stirred, self._stirred = self._stirred, {}
        for key in stirred:
            host = self._hosts.get(key)
            if host is not None and (count := host.newly_freed()):
                self._port.return_credit(key, count)

    def _move(self, bus_ns: int) -> None:
        for robot in self.robots:
            robot.move(bus_ns, self._zero_ns, self._step_ns)

    def _run_to_question(self, end_ns: int, waiting: Sequence[str]) -> str | None:
        """Run until the drives of a robot have sent all of the tick; None at its end."""
        while True:
            for robot in waiting:
                if not self._has_to_send(robot):
                    return robot
            if not self._event(end_ns):
                return None

    def _has_to_send(self, robot: str) -> bool:
        return any(has_to_send(drive) for drive in self._of_robot[robot])

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
        at_ns = self.wire.next_ns()
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

    def _record(self, end_ns: int, frame: Frame, flags: int) -> None:
        """Log what crossed the bus."""
        if self._log is not None:
            self._log.add(end_ns, [frame], flags)

    def _deliver(self, event: Delivered) -> None:
        end_ns, sender, frame = event.end_ns, event.sender, event.frame
        drive = self._of_node.get(sender)
        if drive is not None:
            if not drive.apart:
                self.crossed += 1
                self._transmitted.append(Transmitted(end_ns, frame))
                self._record(end_ns, frame, FROM_DRIVE)
            self._submit_backlog(drive)
            return
        self.crossed += 1
        key = self._key_of.get(sender)
        self._transmitted.append(Transmitted(end_ns, frame, key))
        self._record(end_ns, frame, FROM_DRIVE if key is None else 0)
        if key is not None:
            self._stirred[key] = None
        can_id = frame.can_id
        # A set-point concerns only the drive at its address.
        concerned = [d for d in self._drives if d.drive.setpoint_id == can_id] or self._drives
        for target in concerned:
            if target.node in event.heard_by and not target.apart:
                latency_ns = target.soonest_ns
                if target.latest_ns > latency_ns:
                    latency_ns = self._random.randint(latency_ns, target.latest_ns)
                # In order: firmware reads its mailbox from the front.
                target.looks_ns = max(target.looks_ns, end_ns + latency_ns)
                self._number += 1
                heappush(self._mail, (target.looks_ns, self._number, target, frame))

    def _note_error(self, event: ErrorFrame) -> None:
        senders = (*event.senders, *event.ordered_by)
        if all(node in self._of_node and self._of_node[node].apart for node in senders):
            return  # no client is on that wire
        apart = {key: of_error(event, host.node) for key, host in self._hosts.items()}
        self._transmitted.append(Transmitted(event.at_ns, of_error(event, None), apart=apart))
        self._stirred |= {self._key_of[n]: None for n in event.ordered_by if n in self._key_of}

    def _note_state(self, event: StateChanged) -> None:
        node = event.node
        key = self._key_of.get(node)
        if key is not None:
            before = self._states.get(node, ERROR_ACTIVE)
            self._states[node] = event.state
            self._transmitted.append(Transmitted(event.at_ns, of_state(event, before), to=key))
            self._stirred[key] = None
        elif node in self._of_node and event.state is not BUS_OFF:
            self._submit_backlog(self._of_node[node])

    def _submit_backlog(self, drive: WireDrive) -> None:
        """What waited for a mailbox tries again."""
        if drive.backlog:
            waiting = list(drive.backlog.values())
            drive.backlog.clear()
            self._submit(drive, waiting)

    def _submit(self, drive: WireDrive, frames: Sequence[Frame]) -> None:
        if drive.silent:
            return
        for frame in frames:
            if drive.backlog or not self.wire.submit(drive.node, frame, self._now_ns):
                drive.backlog[frame.can_id] = frame

    def _drive_node(self, name: str) -> Node:
        mailboxes = Mailboxes(self._model.tx_mailboxes)
        restart_ns = self._model.drive_restart_ns
        return self.wire.attach(name, queue=mailboxes, restart_ns=restart_ns, of_drive=True)

    def _host(self, key: Key) -> WireHost:
        model = self._model
        node = self.wire.attach(str(key), queue=Fifo(model.txqueuelen), restart_ns=model.restart_ns)
        host = self._hosts[key] = WireHost(node)
        self._key_of[node] = key
        return host

    def _note_due(self) -> None:
        for drive in self._drives:
            drive.due_ns = drive.drive.next_due_ns

    def _disturb(self, disturbance: Disturbance) -> None:
        """Let this act from now on."""
        disturb(self.wire, self._drives, disturbance)
