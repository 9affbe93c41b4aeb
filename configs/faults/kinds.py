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

A new kind is a class in this room, an entry of `GROUPS`, and its effect: in `plant.faults`,
`agents.faults` or `fleetloop.launch.process_faults`.
"""

from collections.abc import Mapping
from functools import reduce
from itertools import chain
from operator import or_
from typing import TYPE_CHECKING, Annotated, get_args, get_type_hints

from configs.errors import ScenarioError
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
from configs.wording import guess

GROUPS: Mapping[str, tuple[type[Fault], ...]] = {
    "drives": (DriveEvent, DriveError),
    "motors": (MotorTorque, OverTemperature),
    "supply": (UnderVoltage, OverVoltage),
    "encoders": (EncoderState, EncoderJump, EncoderNoise, EncoderSlip),
    "bodies and ground": (Push, Payload, Friction, WheelRadius, WheelSlip),
    "localisation": (PoseBias, PoseJump, PoseDrift, PoseOutage),
    "links between robots": (LinkPartition, LinkLoss, LinkDelay),
    "CAN frames": (FrameChange, FrameCorruption, FrameDelay),
    "CAN buses and their nodes": (BusCut, NodeSilent, NodeBusOff, NodeBabbling),
    "processes of controllers": (ProcessStopped, ProcessRestart, ProcessSlow),
}
"""The classes of all kinds, by what they act on."""
CLASSES: tuple[type[Fault], ...] = tuple(chain.from_iterable(GROUPS.values()))


def kinds_of(cls: type[Fault]) -> tuple[str, ...]:
    """The kinds of a class."""
    return get_args(get_type_hints(cls)["kind"])


KINDS: dict[str, type[Fault]] = {kind: cls for cls in CLASSES for kind in kinds_of(cls)}
"""Every kind and its class."""


def class_of(kind: str) -> type[Fault]:
    """The class of a kind.

    Raises:
        ScenarioError: there is no such kind; the nearest is named.
    """
    if (found := KINDS.get(kind)) is None:
        known = [*KINDS]
        raise ScenarioError(f"{kind}: no such kind{guess(kind, known)} (known: {', '.join(known)})")
    return found


if TYPE_CHECKING:
    AnyFault = Fault
else:
    AnyFault = Annotated[reduce(or_, CLASSES), Tagged("kind")]
"""One entry of [[fault]]."""
