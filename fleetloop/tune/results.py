"""What a tuning leaves: its numbers, the best gains as a fragment of a scenario and as a study.

tune.json        numbers, for programs
best.toml        the best gains: keys of a scenario, and the commands that use them
best_study.toml  the cases under the best gains, for `fleetloop sweep`
"""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from configs.loading import shipped
from configs.overrides import inline
from fleetloop.sweep.cases import expanded
from fleetloop.sweep.draws import Value
from fleetloop.tune.plan import TuningPlan
from fleetloop.tune.scores import Trial
from fleetloop.tune.tables import Judged, shown

NUMBERS, BEST, STUDY = "tune.json", "best.toml", "best_study.toml"
BASELINE_NAME, BEST_NAME = "baseline", "best"
_ROBOT = "robot"


def options(plan: TuningPlan, values: Mapping[str, Value]) -> list[str]:
    """The parameters as --set takes them."""
    return [
        f"{key}={inline(values[one.column])}"
        for one in plan.tuning.parameter
        for key in one.every_key
    ]


def command(plan: TuningPlan, values: Mapping[str, Value], robots: Sequence[str]) -> str:
    """The command that runs the base with these values, as the trials were run."""
    words = ["fleetloop", "run", plan.base.source, "--in-process"]
    for text in plan.tuning.set_:
        words += ["--set", text]
    for key, value in _keys(plan, values, robots):
        words += ["--set", f"{key}={inline(value)}"]
    return shlex.join(words)


def best_toml(plan: TuningPlan, best: Trial, robots: Sequence[str], folder: Path) -> str:
    """The best gains as a fragment of a scenario."""
    tuning, values = plan.tuning, best.values
    lines = [
        f"# The best of {tuning.trials} trials of {tuning.title!r}: trial {best.number},"
        f" {tuning.objective.label} = {shown(best.score.objective)}.",
        "# One run, and all cases:",
        f"#   {command(plan, values, robots)}",
        f"#   fleetloop sweep {shlex.quote(str(folder / STUDY))}",
        "# As options of a command:",
    ]
    pairs = [f"{key}={inline(value)}" for key, value in _keys(plan, values, robots)]
    lines.append(f"#   {' '.join(f'--set {shlex.quote(pair)}' for pair in pairs)}")
    table: dict[str, Any] = {}
    for key, value in _keys(plan, values, robots):
        _put(table, key.split("."), value)
    return "\n".join(lines) + "\n\n" + tomli_w.dumps(table)


def best_study(plan: TuningPlan, best: Trial) -> str:
    """A study of the cases under the best gains."""
    study = plan.tuning.study_of(best.values)
    base = plan.base.source
    if base not in shipped():
        base = str(Path(base).resolve())
    title = f"{plan.tuning.title}: trial {best.number}"
    return study.model_copy(update={"base": base, "title": title[:200]}).to_toml()


def sentences(plan: TuningPlan, best: Trial, judged: Sequence[Judged]) -> list[str]:
    """What a tuning came to."""
    objective = plan.tuning.objective
    if not best.score.feasible:
        missed = ", ".join(
            f"{label} ({shown(best.score.constraints.get(label))})"
            for label, by in best.score.missed.items()
            if by > 0.0
        )
        reason = f"; its first failure: {best.score.reason}" if best.score.reason else ""
        return [f"no feasible trial; trial {best.number} misses least: it misses {missed}{reason}"]
    first = judged[0]
    if first.name != BASELINE_NAME:
        return [f"trial {best.number} is the best: {objective.label} {shown(_value(best))}"]
    if first.trial.number == best.number:
        return ["no trial is better than the baseline"]
    said = [_compared(objective.label, _value(first.trial), _value(best), best.number)]
    if not first.trial.score.feasible:
        said[0] += "; the baseline misses a constraint"
    ours, theirs = judged[-1].checked, first.checked
    if ours is not None and theirs is not None:
        label = f"on {ours.cases} other cases: {objective.label}"
        told = _compared(label, theirs.objective, ours.objective, best.number)
        said.append(told if ours.feasible else f"{told}; a constraint is missed there")
    return said


def _value(trial: Trial) -> float | None:
    return trial.score.objective


def _compared(label: str, before: float | None, after: float | None, number: int) -> str:
    told = f"{label} {shown(after)} by trial {number}, {shown(before)} by the baseline"
    if before and after is not None:
        told += f" ({100 * (after - before) / abs(before):+.1f} %)"
    return told


def numbers(
    plan: TuningPlan, trials: Sequence[Trial], judged: Sequence[Judged], **more: Any
) -> dict[str, Any]:
    """tune.json."""
    tuning = plan.tuning
    return {
        "tuning": tuning.title,
        "base": plan.base.source,
        "objective": tuning.objective.label,
        "direction": tuning.objective.direction,
        "constraints": [one.label for one in tuning.demands],
        "cases": tuning.total,
        "trials": tuning.trials,
        "done": len(trials),
        "feasible": sum(trial.score.feasible for trial in trials),
        **more,
        "judged": {
            one.name: _told(one.trial)
            | {
                "options": options(plan, one.trial.values),
                "other_cases": None if one.checked is None else one.checked.told(),
            }
            for one in judged
        },
        "all": [_told(trial) for trial in trials],
    }


def _told(trial: Trial) -> dict[str, Any]:
    return {
        "trial": trial.number,
        "values": dict(trial.values),
        "feasible": trial.score.feasible,
        **trial.score.told(),
    }


def _keys(
    plan: TuningPlan, values: Mapping[str, Value], robots: Sequence[str]
) -> list[tuple[str, Value]]:
    """Every key that a parameter sets, all robots named."""
    return [
        (key, values[one.column])
        for one in plan.tuning.parameter
        for key in expanded(one.every_key, robots)
    ]


def _put(table: dict[str, Any], path: Sequence[str], value: Value) -> None:
    """Put a value where its key says; what is in another list than that of robots is left out."""
    head, *rest = path
    if not rest:
        table[head] = value
    elif head == _ROBOT and len(rest) > 1:
        robots = table.setdefault(_ROBOT, [])
        found = next((one for one in robots if one["name"] == rest[0]), None)
        if found is None:
            found = {"name": rest[0]}
            robots.append(found)
        _put(found, rest[1:], value)
    elif not rest[0].isdigit():
        _put(table.setdefault(head, {}), rest, value)
