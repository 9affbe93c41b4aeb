"""The pages of docs/reference, made of the types in the code.

`uv run python -m docs.generate` writes them; tests/docs/test_reference.py holds what is committed
against what it would write.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from docs.generate.commands import commands_page
from docs.generate.markdown import prose
from docs.generate.python_api import python_page
from docs.generate.scenario import (
    deployment_page,
    drives_page,
    faults_page,
    laws_page,
    scenario_page,
    study_page,
    tuning_page,
)
from docs.generate.vocabulary import door_page, events_page, network_page, signals_page

FOLDER = Path(__file__).resolve().parents[1] / "reference"
_NOTE = "<!-- Made by `uv run python -m docs.generate` of the types in the code: change those. -->"


class _Page(NamedTuple):
    title: str
    about: str
    body: Callable[[], str]


_PAGES = {
    "scenario.md": _Page(
        "Scenario file",
        """Every section and key of a scenario. An unknown key is an error. Units are in the names
        of the keys; angles are counter-clockwise from world x. `fleetloop check --schema`
        prints the same as JSON Schema, for editors; `fleetloop init` writes a commented file to
        start from.""",
        scenario_page,
    ),
    "laws.md": _Page(
        "Laws",
        """The laws that are shipped: `[control] law = "..."`, or `control = { law = ... }` of a
        robot. The other keys of the table are the law's gains. A law of your own is [a file
        beside the scenario](../own-laws.md); what the paper's equations should be:
        [theory](../theory.md).""",
        laws_page,
    ),
    "drives.md": _Page(
        "Drives",
        """The protocols of section `[drive]` with their keys. A protocol of your own is [a file
        beside the scenario](../drive-protocol.md).""",
        drives_page,
    ),
    "faults.md": _Page(
        "Kinds of faults",
        """The kinds of `[[fault]]` with their parameters. Each has the keys of its kind and
        `kind`, `at_s` [s], `for_s` [s] unless it is an instant, and `name` (the kind, if not
        given). What becomes of a robot: [faults](../faults.md). In the terminal: `fleetloop
        fault kinds`.""",
        faults_page,
    ),
    "signals.md": _Page(
        "Signals",
        """The signals that a run records of every robot at every tick, by their names in
        `fleetloop export`, `[[expect]]` and `record.mcap`. A law adds [its own](laws.md).""",
        signals_page,
    ),
    "events.md": _Page(
        "Events",
        """What happens at a tick: in `summary.json`, the record's channel `log` and `[[expect]]`.
        *Exact*: in lockstep its tick, text and place in the list are determined by scenario and
        seed.""",
        events_page,
    ),
    "commands.md": _Page(
        "Commands",
        """Every verb with its arguments and options, as `-h` prints them; exit statuses.""",
        commands_page,
    ),
    "study.md": _Page(
        "Study file",
        """What `fleetloop sweep` varies, how often, and what it keeps ([sweeps](../sweeps.md)).
        `fleetloop sweep schema` prints the same as JSON Schema, for editors.""",
        study_page,
    ),
    "tuning.md": _Page(
        "Tuning file",
        """What `fleetloop tune` searches, over which cases, for what ([tuning](../tuning.md)): a
        study file, and more.""",
        tuning_page,
    ),
    "deployment.md": _Page(
        "Deployment file",
        """Where the roles, buses and robots of a scenario are, for `--deployment FILE`. Without
        one all of it is on this machine. How to: [a robot](../from-emulation-to-a-robot.md),
        [several hosts](../several-hosts.md).""",
        deployment_page,
    ),
    "network.md": _Page(
        "Keys and messages",
        """The words of the processes of a run to each other over Zenoh, and their rights.""",
        network_page,
    ),
    "python.md": _Page(
        "Python",
        """The names of `import fleetloop`. How to: [from Python](../python.md).""",
        python_page,
    ),
    "door.md": _Page(
        "Requests to a run",
        """The requests that a run that goes on answers at its door, a Unix socket `door` in its
        folder of sockets, for this user only. `fleetloop fault`, `fleetloop steer` and the live
        page are clients of it.""",
        door_page,
    ),
}


def pages() -> dict[str, str]:
    """The text of every page by its name."""
    made = {
        name: f"# {page.title}\n\n{_NOTE}\n\n{prose(page.about)}\n\n{page.body().rstrip()}\n"
        for name, page in _PAGES.items()
    }
    lines = [
        f"* [{page.title}]({name}): {_first(prose(page.about))}" for name, page in _PAGES.items()
    ]
    made["README.md"] = (
        f"# Reference\n\n{_NOTE}\n\nMade of the types in the code.\n\n" + "\n".join(lines) + "\n"
    )
    return made


def _first(about: str) -> str:
    """The first sentence, without links."""
    return about.partition(". ")[0].partition(": ")[0].rstrip(".") + "."
