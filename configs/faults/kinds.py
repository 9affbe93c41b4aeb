"""Section [[fault]]: faults that act on a run, each kind with its parameters.

    [[fault]]
    kind = "torque_half"
    robots = ["r2"]
    at_s = 5.0
    for_s = 2.0

A fault acts from the first tick at or after `at_s` on, for `for_s`, or to the end without it; kinds
that are an instant have no `for_s`. Where it acts depends on its kind:

    plant      bodies, motors, encoders, supplies, drives, buses and the localisation system
    agent      messages to a robot's controller
    process    a robot's controller as a process

A new kind is a class in this room, an entry of `CLASSES`, and its effect: in `plant.faults`,
`agents.faults` or `fleetloop.launch.process_faults`.
"""

from collections.abc import Iterator
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, get_args, get_type_hints

from configs.faults.base import Fault
from configs.faults.bodies import Friction, Payload, Push, WheelRadius, WheelSlip
from configs.faults.buses import (
    BusCut,
    FrameChange,
    FrameCorruption,
    FrameDelay,
    NodeBabbling,
    NodeBusOff,
    NodeSilent,
)
from configs.faults.messages import (
    LinkDelay,
    LinkLoss,
    LinkPartition,
    PoseBias,
    PoseDrift,
    PoseJump,
    PoseOutage,
)
from configs.faults.powertrains import (
    DriveError,
    DriveEvent,
    EncoderJump,
    EncoderNoise,
    EncoderSlip,
    EncoderState,
    MotorTorque,
    OverTemperature,
    OverVoltage,
    UnderVoltage,
)
from configs.faults.processes import ProcessRestart, ProcessSlow, ProcessStopped
from configs.parameters import Tagged

CLASSES: tuple[type[Fault], ...] = (
    DriveEvent,
    DriveError,
    MotorTorque,
    OverTemperature,
    UnderVoltage,
    OverVoltage,
    EncoderState,
    EncoderJump,
    EncoderNoise,
    EncoderSlip,
    Push,
    Payload,
    Friction,
    WheelRadius,
    WheelSlip,
    PoseBias,
    PoseJump,
    PoseDrift,
    PoseOutage,
    LinkPartition,
    LinkLoss,
    LinkDelay,
    FrameChange,
    FrameCorruption,
    FrameDelay,
    BusCut,
    NodeSilent,
    NodeBusOff,
    NodeBabbling,
    ProcessStopped,
    ProcessRestart,
    ProcessSlow,
)


def _kinds() -> Iterator[tuple[str, type[Fault]]]:
    for cls in CLASSES:
        for kind in get_args(get_type_hints(cls)["kind"]):
            yield kind, cls


KINDS: dict[str, type[Fault]] = dict(_kinds())
"""Every kind and its class."""

if TYPE_CHECKING:
    AnyFault = Fault
else:
    AnyFault = Annotated[reduce(or_, CLASSES), Tagged("kind")]
"""One entry of [[fault]]."""
