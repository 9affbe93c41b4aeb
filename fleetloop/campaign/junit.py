"""A campaign as JUnit XML: a suite per kind, a case per time and seed; one without a fault.

failure    the verdict isn't allowed: stopped, failed, diverged
error      the cell brought no result, and that isn't allowed
skipped    the fault can't act, and that is allowed
"""

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from fleetloop.campaign.branches import Baseline
from fleetloop.campaign.matrix import NONE
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.results import junit


def write_junit(
    path: Path,
    scenario: str,
    baselines: Iterable[Baseline],
    results: Sequence[Result],
    allowed: Collection[Verdict],
) -> None:
    """Write a report.

    Raises:
        InfrastructureError: it can't be written.
    """
    suites = {NONE: ET.Element("testsuite", {"name": f"{scenario}: without a fault"})}
    for baseline in baselines:
        name = f"without a fault, seed {baseline.seed}"
        one = junit.case(suites[NONE], f"fleetloop.{scenario}.{NONE}", name, 0.0)
        if baseline.verdict != "held":
            text = f"{baseline.verdict}: {baseline.reason}"
            junit.say(one, "failure", baseline.verdict, text)
    for result in results:
        kind = result.cell.kind
        made = suites.setdefault(kind, ET.Element("testsuite", {"name": f"{scenario}: {kind}"}))
        name = f"{kind} at {result.cell.at_s:g} s, seed {result.cell.seed}"
        one = junit.case(made, f"fleetloop.{scenario}.{kind}", name, result.wall_s)
        text = f"{result.verdict}: {result.reason}" if result.reason else result.verdict.value
        if result.verdict not in allowed:
            tag = "error" if result.verdict is Verdict.ERROR else "failure"
            junit.say(one, tag, result.verdict, f"{text}\n{result.command}")
        elif result.verdict is Verdict.REFUSED:
            junit.say(one, "skipped", result.verdict, text)
    for made in suites.values():
        junit.count(made, sum(float(one.get("time", "0")) for one in made))
    junit.write_suites(path, list(suites.values()))
