"""`fleetloop test`: from paths to verdicts.

Exit status: 0 all held, 1 one failed, was not reached or had an error, 2 usage, 3 infrastructure,
5 nothing to test, 130 interrupted.
"""

import contextlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from configs.errors import ExitStatus
from fleetloop.jobs.pool import processors
from fleetloop.json_lines import JsonLines
from fleetloop.results import run_folder
from fleetloop.results.junit import write_junit
from fleetloop.results.outcome import Outcome
from fleetloop.signals import interruptible, stop_on_signals
from fleetloop.suite.cases import Bounds, Case, case_of, run_cases
from fleetloop.suite.listing import BAD, HELD, Listing, account, counts_of, header, status_of
from fleetloop.suite.selection import SUFFIX, selected
from fleetloop.terminal import say, say_json


@dataclass(frozen=True, slots=True)
class SuiteOptions:
    """Options of the command line for a test of scenarios."""

    select: str = ""
    processes: bool = False
    jobs: int = 0
    """0: as many as there are processors."""
    timeout_s: float = 600.0
    total_s: float = 3600.0
    overrides: tuple[str, ...] = ()
    out: Path | None = None
    keep: bool = False
    """Keep the folders of runs that held."""
    as_json: bool = False
    json_lines: bool = False
    junit: Path | None = None


def run_tests(paths: Sequence[str], options: SuiteOptions) -> int:
    """Run every scenario of these paths, print and save the verdicts; return the exit status.

    Raises:
        ScenarioError: a path or an option is wrong; nothing was started.
        InfrastructureError: a file or a process can't be had.
    """
    sources = selected(paths, options.select)
    at_once = options.jobs or processors()
    lines = JsonLines() if options.json_lines else None
    quiet = options.as_json or options.json_lines
    if lines is not None:
        lines.say("started", command="test", scenarios=list(sources), at_once=at_once)
    if not quiet:
        say(header(version("fleetloop"), len(sources), at_once))
    created = run_folder.create("test", options.out, SYSTEM_CLOCK.wall_ns()) if sources else None
    began_s = SYSTEM_CLOCK.monotonic_s()
    listing = Listing(sources, options.overrides, quiet=quiet)

    def on_done(case: Case, outcome: Outcome) -> None:
        if status_of(outcome) == HELD and not options.keep:
            shutil.rmtree(case.folder, ignore_errors=True)
            outcome["folder"] = None
        listing.show(case.source, outcome)
        if lines is not None:
            lines.say("outcome", scenario=case.source, outcome=outcome)

    outcomes: dict[str, Outcome] = {}
    cases = [] if created is None else _cases(sources, created.path, options)
    with stop_on_signals() as stop:
        if created is not None:
            bounds = Bounds(options.timeout_s, options.total_s, at_once)
            outcomes = run_cases(cases, options.overrides, bounds, stop, on_done)
            with contextlib.suppress(OSError):
                created.path.rmdir()  # if nothing is left in it
    took_s = SYSTEM_CLOCK.monotonic_s() - began_s
    if options.junit is not None:
        write_junit(options.junit, outcomes)
    if options.as_json:
        say_json(_document(outcomes, options, took_s))
    elif lines is None:
        listing.end(outcomes, took_s)
    status = _exit_status(outcomes, stop)
    if lines is not None:
        said = _document(outcomes, options, took_s)
        lines.say("ended", exit_status=int(status), **said)
        lines.end()
    return status


def _exit_status(outcomes: Mapping[str, Outcome], stop: Stop) -> ExitStatus:
    if stop.requested:
        return ExitStatus.INTERRUPTED
    if not outcomes:
        return ExitStatus.NOTHING
    bad = any(status_of(outcome) in BAD for outcome in outcomes.values())
    return ExitStatus.FAILED if bad else ExitStatus.OK


@interruptible
def _cases(sources: Sequence[str], parent: Path, options: SuiteOptions) -> list[Case]:
    """Load all; a signal ends it at once, also inside a module of the user's own."""
    try:
        return [
            case_of(
                source,
                folder,
                options.overrides,
                processes=options.processes,
                within_s=min(options.timeout_s, options.total_s),
            )
            for source, folder in zip(sources, _folders(sources, parent), strict=True)
        ]
    except BaseException:
        parent.rmdir()
        raise


def _document(
    outcomes: Mapping[str, Outcome], options: SuiteOptions, took_s: float
) -> dict[str, object]:
    """All outcomes for programs, and of each what people are told of it."""
    accounts = {
        source: account(source, outcome, options.overrides) if status_of(outcome) in BAD else []
        for source, outcome in outcomes.items()
    }
    return {
        "outcomes": outcomes,
        "accounts": accounts,
        "counts": counts_of(outcomes.values()),
        "took_s": round(took_s, 3),
    }


def _folders(sources: Sequence[str], parent: Path) -> list[Path]:
    """A folder for each run, named after its file."""
    names: dict[str, int] = {}
    folders = []
    for source in sources:
        name = Path(source).name.removesuffix(SUFFIX).removesuffix(".toml")
        names[name] = names.get(name, 0) + 1
        folders.append(parent / (name if names[name] == 1 else f"{name}-{names[name]}"))
    return folders
