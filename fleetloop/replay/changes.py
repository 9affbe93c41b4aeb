"""The controller of a replay: that of the record, or one with other parameters or another law."""

from collections.abc import Sequence
from pathlib import Path

from configs.brief import AgentBrief, Schedule
from configs.connections import NetworkLink
from configs.errors import ScenarioError
from configs.loading import loads, to_toml
from configs.resolve import agent_brief
from configs.scenario import Scenario
from fleetloop.compare.contenders import contender, scenario_under

NOWHERE = NetworkLink("replay", "", "", "")


def brief_of(scenario: Scenario, robot: str) -> AgentBrief:
    """The brief of a robot's controller, as far as a replay needs it."""
    return agent_brief(scenario, robot, network=NOWHERE, bus=())


def changed_brief(
    scenario: Scenario, robot: str, *, law: str | None, sets: Sequence[str]
) -> AgentBrief:
    """The brief of a robot's controller with another law, then with other keys of the scenario.

    Args:
        scenario: of the record.
        robot: its name.
        law: as `--law` takes it.
        sets: as `--set` takes them.

    Raises:
        ScenarioError: the law can't be had, a key is wrong, concerns no controller of this robot,
            or would need inputs that it didn't have.
    """
    before = brief_of(scenario, robot)
    folder = ""
    if law is not None:
        name, folder = _law_and_folder(law)
        option = f"--law {law}"
        scenario = scenario_under(scenario, contender(name, option), folder=folder, option=option)
    brief = _with(scenario, robot, sets, folder)
    for n, text in enumerate(sets):
        try:
            without = _with(scenario, robot, [*sets[:n], *sets[n + 1 :]], folder)
        except ScenarioError:
            continue  # another one needs it
        if without == brief:
            raise ScenarioError(
                f"--set {text}: changes nothing for the controller of {robot}; a replay has no"
                " plant and no other robot, and what reaches the controller is as it was recorded"
            )
    _check_inputs(before, brief, " ".join(f"--set {text}" for text in sets))
    return brief


def _with(scenario: Scenario, robot: str, sets: Sequence[str], folder: str) -> AgentBrief:
    if not sets:
        return brief_of(scenario, robot)
    changed = loads("the record's scenario", to_toml(scenario), sets, folder=folder)
    if robot not in changed.names:
        raise ScenarioError(f"--set {' --set '.join(sets)}: then there is no robot {robot}")
    return brief_of(changed, robot)


def _law_and_folder(text: str) -> tuple[str, str]:
    """A law as a scenario names it, and where its module is: its file may be named by path."""
    first, colon, rest = text.partition(":")
    path = Path(first.removesuffix(".py"))
    if not colon or path == Path(path.name) == Path(first):
        return text, ""
    return f"{path.name}:{rest}", str(path.parent)


def _check_inputs(before: AgentBrief, after: AgentBrief, options: str) -> None:
    """Refuse what would need other inputs than those that were recorded."""
    if _times(before.schedule) != _times(after.schedule):
        raise ScenarioError(
            f"{options}: the recorded inputs came by the record's schedule; its periods, delays and"
            " clock can't be changed in a replay"
        )
    for what, old, new in (
        ("path states of", _speakers(before), _speakers(after)),
        ("the speed of", _leader(before), _leader(after)),
        ("poses of", set(before.located), set(after.located)),
    ):
        if more := sorted(new - old):
            raise ScenarioError(
                f"{options}: needs {what} {', '.join(more)}, which did not reach {before.robot} in"
                " the record"
            )


def _times(schedule: Schedule) -> tuple[int | bool, ...]:
    return (
        schedule.period_ns,
        schedule.countdown_ticks,
        schedule.share_every,
        schedule.localise_every,
        schedule.pose_delay_ticks,
        schedule.realtime,
    )


def _speakers(brief: AgentBrief) -> set[str]:
    return {edge.speaker for edge in brief.hears}


def _leader(brief: AgentBrief) -> set[str]:
    return set() if brief.leader_link is None else {"the leader"}
