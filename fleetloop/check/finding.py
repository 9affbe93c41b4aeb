"""Findings of a check: level, title, numbers, robots concerned, and the key to change."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was checked. An error: it would not work; a warning: it may not."""

    level: Level
    title: str
    text: str
    robots: tuple[str, ...] = ()
    """The robots concerned; empty if it is about the whole scenario."""
    key: str = ""
    """Of the file, to change; "" if nothing has to."""


def likewise(findings: Iterable[Finding]) -> list[Finding]:
    """The first of findings that differ in numbers only, with the names of the other robots."""
    kinds: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        kinds.setdefault((finding.level, finding.title), []).append(finding)
    merged = []
    for first, *rest in kinds.values():
        others = ", ".join(robot for finding in rest for robot in finding.robots)
        merged.append(replace(first, text=f"{first.text}; likewise {others}") if others else first)
    return merged


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
    merged: dict[tuple[str, str, str], Finding] = {}
    for finding in findings:
        same = finding.level, finding.title, finding.text
        known = merged.get(same)
        merged[same] = (
            finding
            if known is None
            else replace(known, robots=tuple(dict.fromkeys([*known.robots, *finding.robots])))
        )
    return list(merged.values())
