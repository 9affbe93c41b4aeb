"""Briefs declare what is derived; what a section declares they hold as it is or inherit."""

import dataclasses
import inspect
import typing
from collections.abc import Iterator
from typing import Any

import pytest

from configs import brief, connections, curves
from configs.drives import Drive
from configs.parameters import Parameters
from configs.scenario import Scenario

RESOLVED = {
    "AgentBrief": {"offset", "s_0", "bus", "seed"},
    "ChannelModel": {"source", "seed"},
    "Drawing": {"edges", "robots"},
    "DriveLink": {"right_node", "left_node"},
    "HostLimits": {
        *("torque_limit_wheel_N_m", "torque_slew_limit_wheel_N_m_s"),
        *("encoder_mismatch_limit_wheel_rad", "pose_mismatch_limit_m"),
    },
    "MotorModel": {"torque_constant_N_m_A", "current_limit_A"},
    "NetworkLink": {"endpoint"},
    "Outside": {"endpoint"},
    "PlantBrief": {"robots", "seed"},
    "PowertrainModel": {"seed"},
    "RecorderBrief": {"robots", "start_deadline_s"},
    "RobotBrief": {"bus", "right_node", "left_node", "v_m_s", "omega_rad_s"},
    "ViewerBrief": {"start_deadline_s"},
    "Wheels": {"radius_m", "half_track_m"},
    "Schedule": {"tick_deadline_s", "start_deadline_s", "on_late"},
    "SplinePath": {"closed"},
}
"""Values that have the name of a key of the file and are settled for one robot or process: of the
robot's own table or the fleet's, of a preset, of the section that another inherits from."""


def sections_in(kind: Any) -> Iterator[type[Parameters]]:
    for inner in typing.get_args(kind):
        yield from sections_in(inner)
    if isinstance(kind, type) and issubclass(kind, Parameters):
        yield kind
        for field in dataclasses.fields(kind):
            yield from sections_in(field.type)


SECTIONS = {
    section for field in Scenario.model_fields.values() for section in sections_in(field.annotation)
} | {Drive}
KEYS = {field.name for section in SECTIONS for field in dataclasses.fields(section)}
BRIEFS = [
    kind
    for module in (brief, connections, curves)
    for _, kind in inspect.getmembers(module, dataclasses.is_dataclass)
    if isinstance(kind, type) and kind.__module__ == module.__name__
]


@pytest.mark.parametrize("kind", BRIEFS, ids=lambda kind: kind.__name__)
def test_a_brief_repeats_no_parameter_of_the_file(kind: type) -> None:
    declared = {
        name
        for name, annotation in kind.__annotations__.items()
        if name in KEYS and not any(sections_in(annotation))
    }
    assert declared <= RESOLVED.get(kind.__name__, set())


def test_the_sections_are_found() -> None:
    assert len(SECTIONS) > 25
    assert {"torque_constant_N_m_A", "radius_m", "heartbeat_age_limit_s"} <= KEYS
