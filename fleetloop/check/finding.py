"""Findings of a check: what, its value, its limit, the verdict, what it rests on, what to change.

error      a necessary condition fails: the scenario can't work, `fleetloop run` refuses it
warning    a sufficient condition fails, or a margin is small: it may not work
ok         the condition holds, or nothing follows from the value
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was checked."""

    level: Level
    title: str
    value: str
    robots: tuple[str, ...] = ()
    """The robots concerned; empty if it is about the whole scenario."""
    key: str = ""
    """Of the file, to change; "" if nothing has to."""
    limit: str = ""
    """What the value has to keep to, as "< 2"; "" if it is in the value's words."""
    remedy: str = ""
    """What to change, in words."""
    basis: str = ""
    """The equation, theorem or note that it rests on; numbers in brackets are the paper's."""

    @property
    def text(self) -> str:
        """Value, limit and remedy in one line."""
        needs = ""
        if self.limit:
            needs = f" {self.limit}" if self.level == "ok" else f", needs {self.limit}"
        return self.value + needs + (f": {self.remedy}" if self.remedy else "")


def resting_on(basis: str, findings: Iterable[Finding]) -> list[Finding]:
    """The same findings, with what they rest on where they don't say it."""
    return [one if one.basis else replace(one, basis=basis) for one in findings]


def in_words(findings: Iterable[Finding]) -> list[str]:
    """A line for each; those that differ in numbers only share the line of the first."""
    kinds: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        kinds.setdefault((finding.level, finding.title), []).append(finding)
    lines = []
    for first, *rest in kinds.values():
        others = ", ".join(robot for finding in rest for robot in finding.robots)
        likewise = f"; likewise {others}" if others else ""
        lines.append(f"{first.level}: {titled(first)}: {first.text}{likewise}")
    return lines


def robots_of(findings: Iterable[Finding]) -> list[str]:
    """The robots of several findings."""
    return [robot for finding in findings for robot in finding.robots]


def worst(findings: Iterable[Finding]) -> Level:
    """The worst level of all."""
    levels = {finding.level for finding in findings}
    return "error" if "error" in levels else "warning" if "warning" in levels else "ok"


def titled(finding: Finding) -> str:
    """The robots concerned, and the title."""
    return f"{', '.join(finding.robots)}: {finding.title}" if finding.robots else finding.title


def named(robots: Sequence[str], everybody: Sequence[str]) -> str:
    """Robots in few words: "all", "r3", "r1 to r4, r7"."""
    if len(robots) == len(everybody) > 1:
        return "all"
    runs: list[list[str]] = []
    for robot in robots:
        at = everybody.index(robot)
        if runs and at > 0 and everybody[at - 1] == runs[-1][-1]:
            runs[-1].append(robot)
        else:
            runs.append([robot])
    spans = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs]
    return ", ".join(spans)


def alike(findings: Iterable[Finding]) -> list[Finding]:
    """The same findings, those that differ in nothing but the robot as one."""
    merged: dict[Finding, Finding] = {}
    for finding in findings:
        same = replace(finding, robots=())
        known = merged.get(same)
        merged[same] = (
            finding
            if known is None
            else replace(known, robots=tuple(dict.fromkeys([*known.robots, *finding.robots])))
        )
    return list(merged.values())
