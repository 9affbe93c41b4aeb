"""An emulated axis, and the few words that tests say to it."""

import struct
from dataclasses import replace

from bridge.drives.interface import DriveMeasurements
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.endpoints import ENDPOINTS
from bridge.drives.odrive.frames import AxisState, Command
from bridge.drives.odrive.model import AxisModel
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import Frame

MS = 1_000_000
NODE = 3
SERIAL_NUMBER = 0xABCDEF
NUMBER = {endpoint.path: endpoint.number for endpoint in ENDPOINTS.values()}
MODEL = AxisModel(
    torque_constant_N_m_A=0.05,
    current_limit_A=10.0,
    velocity_limit_shaft_rev_s=10.0,
    velocity_gain_shaft_N_m_s_rev=1 / 6,
    overspeed_ratio=1.2,
    torque_limiters=True,
    heartbeat_period_ns=100 * MS,
    encoder_period_ns=1 * MS,
    torques_period_ns=0,
    watchdog_ns=100 * MS,
    zero_torque_on_disarm=False,
)
_HEALTHY = {
    "torque_shaft_N_m": 0.0,
    "current_A": 0.0,
    "fet_C": 30.0,
    "motor_C": float("nan"),
    "bus_V": 24.0,
    "bus_A": 0.0,
}
HEALTHY = DriveMeasurements(**_HEALTHY)


def healthy(**changes: float) -> DriveMeasurements:
    return DriveMeasurements(**_HEALTHY | changes)


def axis(**changes) -> OdriveNode:
    return OdriveNode(replace(MODEL, **changes), NODE, SERIAL_NUMBER)


def tell(node: OdriveNode, command: Command, data: bytes = b"", now_ns: int = 0) -> list[Frame]:
    return list(node.on_frame(Frame(f.identifier(node.node_id, command), data), now_ns))


def ask_state(node: OdriveNode, state: int, now_ns: int = 0) -> None:
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(state), now_ns)


def arm(node: OdriveNode, now_ns: int = 0) -> OdriveNode:
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL, now_ns)
    assert node.state is AxisState.CLOSED_LOOP_CONTROL
    return node


def torque(node: OdriveNode, value: float, now_ns: int = 0) -> None:
    tell(node, Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(value), now_ns)


def floats(node: OdriveNode, command: Command, *values: float, now_ns: int = 0) -> None:
    data = b"".join(f.ONE_FLOAT.pack(value) for value in values)
    tell(node, command, data, now_ns)


def modes(node: OdriveNode, control: int, inputs: int = 1) -> None:
    tell(node, Command.SET_CONTROLLER_MODE, f.TWO_U32.pack(control, inputs))


def beat(node: OdriveNode, now_ns: int = 0) -> f.Heartbeat:
    (frame,) = node.on_frame(f.request(node.node_id, Command.HEARTBEAT), now_ns)
    return f.decode_heartbeat(frame.data)


def asked(node: OdriveNode, command: Command, now_ns: int = 0) -> tuple[float, float]:
    (frame,) = node.on_frame(f.request(node.node_id, command), now_ns)
    return f.decode_floats(frame.data)


def read(node: OdriveNode, path: str, code: str = "f") -> float:
    (reply,) = tell(node, Command.RX_SDO, struct.pack("<BHBI", 0, NUMBER[path], 0, 0))
    assert reply.can_id == f.identifier(NODE, Command.TX_SDO)
    assert struct.unpack_from("<BHB", reply.data) == (0, NUMBER[path], 0)
    return struct.unpack_from(f"<{code}", reply.data, 4)[0]


def write(node: OdriveNode, path: str, value: float, code: str = "f") -> list[Frame]:
    data = struct.pack(f"<BHB{code}", 1, NUMBER[path], 0, value)
    return tell(node, Command.RX_SDO, data)
