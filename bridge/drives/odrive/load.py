"""The cyclic messages of an ODrive axis and of its controller, for the load of a bus.

Heartbeat and encoder frames of the drive, a set-point every control period, and the other messages
that the scenario makes cyclic. Payloads are those of a moving robot, at the shaft.
"""

from collections.abc import Sequence
from typing import Final

from bridge.drives.interface import CyclicMessage
from bridge.drives.odrive.frames import (
    HEARTBEAT,
    ONE_FLOAT,
    TWO_FLOATS,
    AxisState,
    Command,
    identifier,
)
from bridge.drives.odrive.model import AxisModel
from configs.brief import DriveModel

_SAMPLES: Final = 64
_WHEEL_REV_S: Final = 2.4  # a wheel of 4 cm radius at 0.6 m/s
_WHEEL_N_M: Final = 0.05


def cyclic_messages(
    model: DriveModel, node: int, period_ns: int, gear: float
) -> list[CyclicMessage]:
    """All of one axis; `gear`: signed shaft revolutions per wheel revolution."""
    axis = AxisModel.of(model)
    heartbeat = HEARTBEAT.pack(0, AxisState.CLOSED_LOOP_CONTROL, 0, 0, 0)
    speeds = [gear * _WHEEL_REV_S * (1 + 0.001 * n) for n in range(_SAMPLES)]
    torques = [_WHEEL_N_M / gear * (1 + 0.01 * n) for n in range(_SAMPLES)]
    positions = [gear * 0.0024 * n for n in range(1, _SAMPLES + 1)]
    others = [TWO_FLOATS.pack(24.0 - 0.01 * n, 0.3 + 0.003 * n) for n in range(_SAMPLES)]
    cyclic: dict[Command, tuple[int, Sequence[bytes]]] = {
        Command.HEARTBEAT: (axis.heartbeat_period_ns, [heartbeat]),
        Command.GET_ENCODER_ESTIMATES: (
            axis.encoder_period_ns,
            [TWO_FLOATS.pack(*pair) for pair in zip(positions, speeds, strict=True)],
        ),
        Command.SET_INPUT_TORQUE: (period_ns, [ONE_FLOAT.pack(torque) for torque in torques]),
        Command.GET_TORQUES: (
            axis.torques_period_ns,
            [TWO_FLOATS.pack(torque, torque * 1.003) for torque in torques],
        ),
        Command.GET_ERROR: (axis.error_period_ns, [bytes(8)]),
        Command.GET_IQ: (axis.iq_period_ns, others),
        Command.GET_TEMPERATURE: (axis.temperature_period_ns, others),
        Command.GET_BUS_VOLTAGE_CURRENT: (axis.bus_voltage_period_ns, others),
        Command.GET_POWERS: (axis.powers_period_ns, others),
    }
    return [
        CyclicMessage(identifier(node, command), every_ns, payloads)
        for command, (every_ns, payloads) in cyclic.items()
        if every_ns
    ]
