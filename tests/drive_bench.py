"""One emulated axis and ways to talk to it, for the tests of the drive."""

from dataclasses import replace
from typing import Any

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisState, Command
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import Frame
from configs.brief import DriveModel

MS = 1_000_000
NODE = 3
SERIAL = 0xABCDEF
MODEL = DriveModel(
    protocol="odrive",
    torque_constant_N_m_A=0.05,
    current_limit_A=10.0,
    velocity_limit_rev_s=10.0,
    velocity_gain_N_m_s_rev=1 / 6,
    overspeed_ratio=1.2,
    torque_limiters=True,
    heartbeat_period_ns=100 * MS,
    encoder_period_ns=10 * MS,
    torques_period_ns=0,
    watchdog_ns=0,
    zero_torque_on_disarm=False,
    serial_number=SERIAL,
)


class Bench:
    """An axis on a bench: time passes, its wheel may turn."""

    def __init__(self, **changes: Any) -> None:
        self.node = OdriveNode(replace(MODEL, **changes), NODE, SERIAL)
        self.now_ns = 0

    def tell(self, command: Command, data: bytes = b"", *, flags: int = 0) -> list[Frame]:
        frame = Frame(f.identifier(self.node.node_id, command) | flags, data)
        return list(self.node.hear(frame, self.now_ns))

    def state(self, state: int) -> None:
        self.tell(Command.SET_AXIS_STATE, f.ONE_U32.pack(state))

    def arm(self) -> "Bench":
        self.state(AxisState.CLOSED_LOOP_CONTROL)
        assert self.node.state is AxisState.CLOSED_LOOP_CONTROL
        return self

    def torque(self, value: float) -> None:
        self.tell(Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(value))

    def modes(self, control: int, mode: int) -> None:
        self.tell(Command.SET_CONTROLLER_MODE, f.TWO_U32.pack(control, mode))

    def demand(self, dt_s: float = 0.001) -> float:
        return self.node.torque_demand(dt_s)

    def wait(self, seconds: float) -> list[Frame]:
        """Let time pass in milliseconds; what the axis says meanwhile."""
        said: list[Frame] = []
        for _ in range(round(seconds * 1000)):
            self.now_ns += MS
            said += self.node.due(self.now_ns)
        return said

    def heartbeat(self) -> f.Heartbeat:
        (frame,) = self.node.hear(f.request(self.node.node_id, Command.HEARTBEAT), self.now_ns)
        return f.decode_heartbeat(frame.data)
