"""A change of v_r that is ordered during a run: held to the section [leader] of its scenario."""

import tomllib
from typing import TYPE_CHECKING, Any

import tomli_w

from configs.loading import loads, to_toml

if TYPE_CHECKING:
    from configs.scenario import Scenario

WHERE = "ordered"


def with_step(scenario: "Scenario", t_s: float, speed_m_s: float, ramp_s: float) -> "Scenario":
    """The scenario with one more step of v_r, in the place of one at the same time.

    Args:
        scenario: of the run, with the steps that were ordered before.
        t_s: when it begins, in scenario time.
        speed_m_s: after it.
        ramp_s: how long it takes.

    Raises:
        ScenarioError: all that is wrong with it, in the words of the section, a line each.
    """
    data: dict[str, Any] = tomllib.loads(to_toml(scenario))
    at_ns = round(t_s * 1e9)
    steps = [one for one in data["leader"].get("steps", ()) if round(one["t_s"] * 1e9) != at_ns]
    steps.append({"t_s": t_s, "speed_m_s": speed_m_s, "ramp_s": ramp_s})
    data["leader"]["steps"] = sorted(steps, key=lambda one: float(one["t_s"]))
    return loads(WHERE, tomli_w.dumps(data), recorded=True)
