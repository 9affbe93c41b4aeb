"""What isn't analysed of a law, because it doesn't tell of itself, or raises when it is asked."""

from collections.abc import Iterator

from configs.scenario import Scenario
from fleetloop.check.finding import Finding
from fleetloop.law_facts import asked, offers

ANALYSES = {
    "torque_limit_wheel_N_m": "its own torque limit",
    "approach_rate_1_s": "catching up after a limit",
    "lateral_gain_1_m": "motion backwards",
    "speed_gain_N_m_s": "the sampled speed loop",
    "loop_elements": "the sampled loop near the path",
    "adaptation_limit": "sampled adaptation",
}
"""What of a law is analysed, by the method of `Law` that tells it."""


def law_findings(scenario: Scenario) -> Iterator[Finding]:
    """What isn't analysed of each robot's law."""
    period_s = scenario.clock.control_period_s
    for robot in scenario.robot:
        control = scenario.control_of(robot)
        missing = [name for name in ANALYSES if not offers(control, name)]
        if missing:
            each = ", ".join(f"{ANALYSES[name]} ({name})" for name in missing)
            text = f"law {control.name} doesn't tell: {each}"
            yield Finding("ok", "not analysed", text, (robot.name,))
        for name, what in ANALYSES.items():
            trouble = "" if name == "loop_elements" else asked(control, name, period_s).trouble
            if trouble:
                text = f"{what}: law {control.name}, {name}: {trouble}"
                yield Finding("warning", "not analysed", text, (robot.name,), "control.law")
