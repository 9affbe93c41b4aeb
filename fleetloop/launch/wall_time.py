"""The expected wall time of a run, and a warning before one that takes days."""

from configs.scenario import Scenario

DAY_S = 86_400.0
_IN_PROCESS_S, _OVER_PROCESSES_S = 25e-6, 75e-6
"""Of a robot and tick, on an ordinary machine."""


def warning(scenario: Scenario, *, speed: float, in_process: bool) -> str | None:
    """A sentence for a run that will take a day or more, None for others.

    `speed` is the multiple of real time that it is held to; 0: as fast as the machine can.
    """
    wall_s = _expected_s(scenario, speed=speed, in_process=in_process)
    if wall_s < DAY_S:
        return None
    days = wall_s / DAY_S
    at = f" at {speed:g} × real time" if speed else ""
    return (
        f"{scenario.name}: {scenario.ends_at_s:g} s of scenario time will take about"
        f" {days:.3g} days{at}; Ctrl-C ends it and keeps the record until then"
    )


def _expected_s(scenario: Scenario, *, speed: float, in_process: bool) -> float:
    if scenario.clock.mode == "realtime":
        return scenario.ends_at_s
    ticks = scenario.ends_at_s / scenario.clock.control_period_s
    each_s = _IN_PROCESS_S if in_process else _OVER_PROCESSES_S
    fastest_s = ticks * len(scenario.robot) * each_s
    return max(fastest_s, scenario.ends_at_s / speed) if speed else fastest_s
