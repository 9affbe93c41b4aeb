"""The emulated ODrive on its bus: an axis (`local_axis`) with CANSimple around it, firmware 0.6.

    message         what it does                                          where
    Get_...         answered to a remote or empty frame, and cyclic       `reports`
    Set_..., Clear  acts; a remote frame is ignored                       `commands`
    Estop           acts, whatever the frame                              `local_axis`
    RxSdo           reads or writes an endpoint, TxSdo answers            `endpoints`
                    calls a function                                      `functions`
    Address         asked: says node id and serial number
                    our serial number or 0: takes the node id
                    our node id, another serial number: goes to 0x3F
    Reboot 0, 1, 2  only in IDLE: silent for a while, then powered up with the saved parameters;
                    1 saves the present ones first, 2 the vendor's
    Reboot 3, DFU   only in IDLE: gone from the bus for good

A drive at 0x3F is unaddressed: it sends no cyclic messages, processes only Address, and answers it
after a random delay, because all unaddressed drives answer with the same identifier. Every drive
processes Address at 0x3F.
Frames of other nodes, 29-bit and error frames, unknown commands and the drive's own messages are
ignored; none of these, no request and no endpoint feeds the watchdog.

A message that is late is sent once; its next is due at the next multiple of its period.
"""

from collections.abc import Sequence
from random import Random
from typing import Final

from bridge.drives.odrive import endpoints, functions
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.calibration import NEVER
from bridge.drives.odrive.commands import SETTERS
from bridge.drives.odrive.frames import AxisState, Command, RebootAction
from bridge.drives.odrive.local_axis import LocalAxis
from bridge.drives.odrive.model import AxisModel
from bridge.drives.odrive.parameters import FLOAT32_MAX, Parameters
from bridge.drives.odrive.reports import REPORTS, address, floats
from bridge.frame import EFF, ERR, RTR, Frame

ANSWER_WITHIN_NS: Final = 20_000_000
"""Longest delay of an unaddressed drive's answer to Address."""
_NONE: Final[Sequence[Frame]] = ()


class OdriveNode(LocalAxis):
    """One axis on the bus."""

    __slots__ = (
        "_answers_ns",
        "_boots_ns",
        "_cyclic_ns",
        "_encoder_id",
        "_encoder_period_ns",
        "_next_encoder_ns",
        "_next_other_ns",
        "_random",
        "_saved",
        "ignored",
        "setpoint_id",
    )

    _next_encoder_ns: int
    _next_other_ns: int

    def __init__(self, model: AxisModel, node_id: int, serial_number: int) -> None:
        super().__init__(model, serial_number)
        self._random = Random(serial_number)
        self._saved = Parameters.of(model, node_id)
        self.ignored = 0
        self._boot(0)

    def _boot(self, now_ns: int) -> None:
        """Power up; all cyclic messages are due at once."""
        self.power_up(self._saved.copy())
        self._boots_ns = self._answers_ns = NEVER
        self._cyclic_ns = dict.fromkeys(self.parameters.period_ns, now_ns)
        self._plan()

    @property
    def node_id(self) -> int:
        """The address on the bus."""
        return self.parameters.node_id

    # --- the hot path ----------------------------------------------------------------------------

    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """Process one frame from the bus; return the replies."""
        can_id, data = frame.can_id, frame.data
        if can_id == self.setpoint_id and len(data) == 4:
            if now_ns - self.fed_ns > self._silence_ns:
                self.supervise(now_ns)
            torque = f.float_at(data, 0)
            if -FLOAT32_MAX <= torque <= FLOAT32_MAX:
                self.fed_ns = now_ns
                self.input_torque_shaft = torque
            else:
                self.set_torque(torque, now_ns)
            return _NONE
        if can_id & (EFF | ERR) or now_ns < self._boots_ns != NEVER:
            return _NONE
        if self._boots_ns != NEVER:
            self._boot(now_ns)
        return self._on_frame(frame, now_ns)

    def due(self, now_ns: int) -> Sequence[Frame]:
        """Frames due until this instant; the watchdog is checked first."""
        if not self._plain or now_ns - self.fed_ns > self._silence_ns:
            self.supervise(now_ns)
        encoder = now_ns >= self._next_encoder_ns
        if now_ns < self._next_other_ns:
            if not encoder:
                return _NONE
            period_ns = self._encoder_period_ns
            self._next_encoder_ns = (now_ns // period_ns + 1) * period_ns
            return (self._encoder_estimates(),)
        return self._due(now_ns)

    @property
    def state_in_words(self) -> str:
        """As a heartbeat says it: the axis's state, and its errors if there are any."""
        errors = self.errors | self.disarm_reason
        return f"{self.state.name}: {f.error_names(errors)}" if errors else self.state.name

    @property
    def next_due_ns(self) -> int:
        """The earliest bus time at which `due` has an effect."""
        next_ns = min(self._next_encoder_ns, self._next_other_ns)
        return min(next_ns, self.fed_ns + self._silence_ns + 1)

    def feedback(self, now_ns: int) -> Frame:
        """The encoder frame out of its turn; the next cyclic one comes a period later."""
        period_ns = self.parameters.period_ns[Command.GET_ENCODER_ESTIMATES]
        if period_ns:
            self._next_encoder_ns = now_ns + 2 * period_ns
        return self._encoder_estimates()

    def _encoder_estimates(self) -> Frame:
        try:
            data = f.floats_data(self.position, self.velocity)
        except OverflowError:  # a robot that diverges
            data = floats(self.position, self.velocity)
        return Frame(self._encoder_id, data)

    # --- transmission ----------------------------------------------------------------------------

    def _due(self, now_ns: int) -> Sequence[Frame]:
        """All due frames, in the general case."""
        if now_ns >= self._boots_ns:
            self._boot(now_ns)
        self.supervise(now_ns)
        frames = []
        if now_ns >= self._answers_ns:
            self._answers_ns = NEVER
            frames.append(self._frame(Command.ADDRESS, address(self)))
        self._cyclic_ns[Command.GET_ENCODER_ESTIMATES] = self._next_encoder_ns
        if self._speaks:
            for command, period_ns in self.parameters.period_ns.items():
                if period_ns and now_ns >= self._cyclic_ns[command]:
                    self._cyclic_ns[command] = (now_ns // period_ns + 1) * period_ns
                    frames.append(self._frame(command, REPORTS[command](self)))
        self._plan()
        return frames

    @property
    def _speaks(self) -> bool:
        return self._boots_ns == NEVER and self.parameters.node_id != f.UNADDRESSED

    def _plan(self) -> None:
        """Derive the hot path's due times and identifiers from address and periods."""
        node, next_ns, encoder_ns = self.parameters.node_id, NEVER, NEVER
        if self._speaks:
            for command, period_ns in self.parameters.period_ns.items():
                if not period_ns:
                    continue
                if command is Command.GET_ENCODER_ESTIMATES:
                    encoder_ns = self._cyclic_ns[command]
                else:
                    next_ns = min(next_ns, self._cyclic_ns[command])
        self._encoder_id = f.identifier(node, Command.GET_ENCODER_ESTIMATES)
        self._encoder_period_ns = self.parameters.period_ns[Command.GET_ENCODER_ESTIMATES]
        self.setpoint_id = f.identifier(node, Command.SET_INPUT_TORQUE) if self._speaks else -1
        self._next_encoder_ns = encoder_ns
        self._next_other_ns = min(
            next_ns, self._boots_ns, self._answers_ns, self.calibration.ends_ns
        )

    # --- reception -------------------------------------------------------------------------------

    def _on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        can_id, data = frame.can_id, frame.data
        node, command = (can_id & 0x7FF) >> f.BITS, can_id & 0x1F
        ours = self.parameters.node_id
        if command == Command.ADDRESS and node in (ours, f.UNADDRESSED):
            return self._on_address(frame, now_ns)
        if node != ours or ours == f.UNADDRESSED:
            return _NONE
        self.supervise(now_ns)
        report = REPORTS.get(command)
        if report is not None:
            if f.is_request(frame):
                return (self._frame(command, report(self)),)
            self.ignored += 1  # another node imitates a drive
            return _NONE
        if command == Command.ESTOP:
            self.estop()
        elif can_id & RTR:
            self.ignored += 1
        elif command == Command.RX_SDO:
            return self._on_sdo(data, now_ns)
        elif command in (Command.REBOOT, Command.ENTER_DFU_MODE):
            self._on_reboot(command, data, now_ns)
        else:
            setter = SETTERS.get(command)
            if setter is None or not setter(self, data, now_ns):
                self.ignored += 1
        self._replan()
        return _NONE

    def _frame(self, command: int, data: bytes) -> Frame:
        return Frame(self.parameters.node_id << f.BITS | command, data)

    def _replan(self) -> None:
        self._cyclic_ns[Command.GET_ENCODER_ESTIMATES] = self._next_encoder_ns
        self._plan()

    def _on_sdo(self, data: bytes, now_ns: int) -> Sequence[Frame]:
        before = dict(self.parameters.period_ns)
        said = self._answer(data, now_ns)
        self._cyclic_ns[Command.GET_ENCODER_ESTIMATES] = self._next_encoder_ns
        for command, period_ns in self.parameters.period_ns.items():
            if period_ns and period_ns != before[command]:
                self._cyclic_ns[command] = (now_ns // period_ns + 1) * period_ns
        self._plan()
        if said is None:
            self.ignored += len(data) < f.SDO.size
            return _NONE
        return (self._frame(Command.TX_SDO, said),)

    def _answer(self, data: bytes, now_ns: int) -> bytes | None:
        """The data of TxSdo in answer to an RxSdo; None for no answer."""
        if len(data) < f.SDO.size:
            return None
        if f.SDO.unpack_from(data)[1] in functions.FUNCTIONS:
            confirms = self.model.firmware_version >= endpoints.ANSWERS_WRITES
            return functions.answer(self, data, now_ns, confirms=confirms)
        return endpoints.answer(self, data, now_ns)

    def _on_reboot(self, command: int, data: bytes, now_ns: int) -> None:
        action = f.padded(data, 1)[0] if command == Command.REBOOT else RebootAction.ENTER_DFU_MODE
        self.ignored += not self.restart(action, now_ns)

    def restart(self, action: int, now_ns: int) -> bool:
        """Do a `RebootAction`; False if it has no effect, as while the axis isn't idle."""
        if self.state is not AxisState.IDLE or action > RebootAction.ENTER_DFU_MODE:
            return False
        match action:
            case RebootAction.SAVE_CONFIGURATION:
                self._saved = self.parameters.copy()
            case RebootAction.ERASE_CONFIGURATION:
                self._saved = Parameters.of(self.model, self._saved.node_id)
        if action == RebootAction.ENTER_DFU_MODE:
            self._go_silent(2 * NEVER)
        else:
            self.reboot(now_ns)
        return True

    def reboot(self, now_ns: int) -> None:
        """Boot anew, whatever the axis is doing: idle and silent for a while, then powered up."""
        self._to_idle()
        self._go_silent(now_ns + self.model.boot_ns)
        if self._boots_ns <= now_ns:
            self._boot(now_ns)

    def _go_silent(self, until_ns: int) -> None:
        self._boots_ns, self._answers_ns = until_ns, NEVER
        self._replan()

    def _on_address(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        data = frame.data
        if f.is_request(frame):
            if self._speaks:
                return (self._frame(Command.ADDRESS, address(self)),)
            if self._answers_ns == NEVER:
                self._answers_ns = now_ns + self._random.randint(1, ANSWER_WITHIN_NS)
                self._replan()
            return _NONE
        if len(data) < 7:
            self.ignored += 1
            return _NONE
        node, serial = data[0], int.from_bytes(data[1:7], "little")
        if node <= f.UNADDRESSED and serial in (0, self.serial):
            self._readdress(node, now_ns)
        elif node == self.parameters.node_id:
            self._readdress(f.UNADDRESSED, now_ns)
        return _NONE

    def _readdress(self, node: int, now_ns: int) -> None:
        if node == self.parameters.node_id:
            return
        self.parameters.node_id = node
        self._answers_ns = NEVER
        for command, period_ns in self.parameters.period_ns.items():
            if period_ns:
                self._cyclic_ns[command] = (now_ns // period_ns + 1) * period_ns
        self._plan()
