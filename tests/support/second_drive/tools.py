"""Section, load and decoder of the test's protocol."""

import struct
from dataclasses import dataclass

from bridge.drives.interface import CyclicMessage, NodeSeen
from bridge.frame import EFF, ERR, Frame
from configs.brief import DriveModel
from configs.drives import Drive
from configs.parameters import Positive, parameter

MOTION, TORQUE = 0x100, 0x200
ENCODER = struct.Struct("<ii")
SET_POINT = struct.Struct("<h")
REV, REV_S = 1e-6, 1e-5
ERRORS = ("OVER_LOAD", "LOST_PHASE")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainSection(Drive):
    """The shared keys of [drive] and one more."""

    torque_unit_shaft_N_m: Positive = parameter(1e-3, "one step of a set-point")

    def errors(self) -> tuple[str, ...]:
        return ERRORS

    def fault_problem(self, kind: str) -> str | None:
        return "these drives have no watchdog" if kind == "drive_watchdog" else None


def cyclic_messages(
    model: DriveModel, node: int, period_ns: int, gear: float
) -> list[CyclicMessage]:
    turned = round(gear * 2.4 / REV_S)
    return [
        CyclicMessage(MOTION + node, model.encoder_period_ns, [ENCODER.pack(turned, turned)]),
        CyclicMessage(TORQUE + node, period_ns, [SET_POINT.pack(50)]),
    ]


def node_seen(frame: Frame) -> NodeSeen | None:
    can_id = frame.can_id
    known = not can_id & (EFF | ERR) and can_id & 0x700 in (MOTION, TORQUE)
    return NodeSeen(can_id & 0xFF, "ON") if known else None


def words(frame: Frame) -> str:
    seen = node_seen(frame)
    return f"plain node {seen.node}" if seen else ""
