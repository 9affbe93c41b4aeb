"""Outcomes as JUnit XML, as Jenkins' xUnit plug-in (junit-10.xsd), GitLab and others read it.

testsuite    a scenario
testcase     "run", then each expectation by its name or what it says
failure      an expectation failed, or a robot stopped itself
error        not reached, or the run itself: refused, aborted, interrupted, cut short
skipped      not reached, if that was allowed
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from fleetloop.results import run_folder
from fleetloop.results.outcome import Outcome
from fleetloop.results.tables import claim, trouble_lines

_FORBIDDEN = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML can't have."""
_ENDED = ("held", "failed", "not checked")


def write_junit(
    path: Path, outcomes: Mapping[str, Outcome], *, allow_unchecked: bool = False
) -> None:
    """Write a report.

    Args:
        path: of the file; its folder is made.
        outcomes: by the name of the suite: the scenario as it was given.
        allow_unchecked: what was not reached is no error.

    Raises:
        InfrastructureError: it can't be written.
    """
    write_suites(path, [suite(name, one, allow_unchecked) for name, one in outcomes.items()])


def write_suites(path: Path, suites: Sequence[ET.Element]) -> None:
    """Write a report of suites.

    Raises:
        InfrastructureError: it can't be written.
    """
    root = ET.Element("testsuites", {"name": "fleetloop", **_totals(suites)})
    root.extend(suites)
    ET.indent(root)
    run_folder.make_parents(path)
    run_folder.write(path, ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


def suite(name: str, outcome: Outcome, allow_unchecked: bool) -> ET.Element:
    """The suite of one scenario."""
    made = ET.Element("testsuite", {"name": _text(name)})
    properties = ET.SubElement(made, "properties")
    for key in ("scenario", "verdict", "mode", "seed", "folder"):
        if outcome.get(key) is not None:
            ET.SubElement(properties, "property", {"name": key, "value": _text(outcome[key])})
    class_name = _class_name(name)
    ran = case(made, class_name, "run", outcome["took_s"])
    for tag, kind, text in _of_run(outcome):
        say(ran, tag, kind, text)
    taken: Counter[str] = Counter()
    for expect in outcome["expectations"]:
        called = expect.get("name") or expect["claim"]
        taken[called] += 1
        again = "" if taken[called] == 1 else f" ({taken[called]})"
        one = case(made, class_name, called + again, 0.0)
        if expect["held"] is False:
            say(one, "failure", "expectation", claim(expect))
        elif expect["held"] is None:
            tag = "skipped" if allow_unchecked else "error"
            say(one, tag, "not reached", claim(expect))
    count(made, outcome["took_s"])
    if outcome.get("started"):
        made.set("timestamp", _text(outcome["started"]))
    return made


def _class_name(name: str) -> str:
    """The class of the cases of a suite: its path with dots, as readers tell cases apart by it."""
    parts = Path(name.removesuffix(".toml")).parts
    return _text(".".join(("fleetloop", *(part for part in parts if part not in ("/", "..")))))


def count(made: ET.Element, took_s: float) -> None:
    """Set the totals of a suite of its cases."""
    cases = made.findall("testcase")
    made.set("tests", str(len(cases)))
    for attribute, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        made.set(attribute, str(sum(one.find(tag) is not None for one in cases)))
    made.set("time", f"{took_s:.3f}")


def _of_run(outcome: Outcome) -> list[tuple[str, str, str]]:
    """What is wrong with a run besides its expectations: tag, type and text."""
    if outcome["verdict"] not in _ENDED:
        return [("error", outcome["verdict"], outcome["reason"] or outcome["verdict"])]
    if outcome.get("stopped_robots"):
        return [("failure", "stopped", "\n".join(trouble_lines(outcome)))]
    if outcome.get("cut_short"):
        lines = (f"{robot}: {how}" for robot, how in outcome["cut_short"].items())
        return [("error", "cut short", "\n".join(lines))]
    return []


def case(parent: ET.Element, class_name: str, name: str, took_s: float) -> ET.Element:
    """Add a case to a suite."""
    attributes = {"classname": class_name, "name": _text(name), "time": f"{took_s:.3f}"}
    return ET.SubElement(parent, "testcase", attributes)


def say(one: ET.Element, tag: str, kind: str, text: str) -> None:
    """Say of a case that it failed, was an error, or was skipped, and why."""
    first = text.partition("\n")[0]
    ET.SubElement(one, tag, {"type": kind, "message": _text(first)}).text = _text(text)


def _totals(suites: Sequence[ET.Element]) -> dict[str, str]:
    totals = {key: str(sum(int(it.get(key, "0")) for it in suites)) for key in _COUNTS}
    took_s = sum(float(it.get("time", "0")) for it in suites)
    return {**totals, "time": f"{took_s:.3f}"}


_COUNTS = ("tests", "failures", "errors")


def _text(value: Any) -> str:
    return _FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", str(value))
