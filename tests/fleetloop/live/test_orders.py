"""Orders of a page: the run's requests and nothing else, from the viewer that has the controls."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.errors import ScenarioError
from fleetloop.live.orders import ARGUMENTS, MOST_BYTES, Controls, Order, parsed


def test_an_order_has_its_arguments_and_whole_numbers_count_as_numbers() -> None:
    said = parsed('{"id": 3, "request": "run.leader_speed", "speed_m_s": 1, "ramp_s": 0.5}')
    assert said == Order(3, "run.leader_speed", {"speed_m_s": 1.0, "ramp_s": 0.5})
    assert type(said.arguments["speed_m_s"]) is float


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (7, "a text"),
        ("x" * (MOST_BYTES + 1), "a text of at most"),
        ("[" * 10_000, "an object of JSON"),
        ("[]", "whole number as its id"),
        ('{"request": "run.pause"}', "whole number as its id"),
        ('{"id": true, "request": "run.pause"}', "whole number as its id"),
        ('{"id": 1, "request": "live.open"}', "'live.open': no such order"),
        ('{"id": 1, "request": ["run.stop"]}', "no such order"),
        ('{"id": 1, "request": "run.step"}', "run.step: takes ticks"),
        ('{"id": 1, "request": "run.pause", "ticks": 1}', "takes no arguments"),
        ('{"id": 1, "request": "run.step", "ticks": 1.5}', "ticks must be of type int"),
        ('{"id": 1, "request": "run.step", "ticks": true}', "ticks must be of type int"),
        ('{"id": 1, "request": "run.speed", "factor": NaN}', "an object of JSON"),
        ('{"id": 1, "request": "fault.inject", "fault": []}', "fault must be of type dict"),
    ],
)
def test_what_is_no_order_is_refused_with_the_reason(text: object, why: str) -> None:
    with pytest.raises(ScenarioError, match=why.replace("[", r"\[")):
        parsed(text)


@given(st.text())
def test_any_text_is_an_order_or_refused(text: str) -> None:
    with contextlib.suppress(ScenarioError):
        assert parsed(text).request in ARGUMENTS


def test_one_viewer_has_the_controls_and_others_are_told_which() -> None:
    controls = Controls()
    with pytest.raises(ScenarioError, match="take them first"):
        controls.check("viewer 1")
    controls.take("viewer 1")
    controls.check("viewer 1")
    with pytest.raises(ScenarioError, match="viewer 1 has the controls"):
        controls.check("viewer 2")
    controls.release("viewer 2")
    assert controls.holder == "viewer 1"
    controls.take("viewer 2")
    with pytest.raises(ScenarioError, match="viewer 2 has the controls"):
        controls.check("viewer 1")
    controls.release("viewer 2")
    assert controls.holder is None
