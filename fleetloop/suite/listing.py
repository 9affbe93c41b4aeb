"""Output of `fleetloop test`: a line per scenario, what failed and how to repeat it, counts."""

import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from fleetloop.results.outcome import REFUSED, Outcome
from fleetloop.results.tables import wrong_lines
from fleetloop.terminal import say

HELD, FAILED, ERROR, SKIPPED = "held", "failed", "error", "skipped"
BAD = (FAILED, ERROR)
_ORDER = (FAILED, ERROR, HELD, SKIPPED)
_WIDTH = 79


def status_of(outcome: Outcome) -> str:
    """One word: held; failed, or not reached; error: no verdict; skipped: nothing is expected."""
    if outcome["verdict"] == "failed":
        return FAILED
    if outcome["verdict"] not in ("held", "not checked") or outcome["cut_short"]:
        return ERROR
    if not outcome["expectations"]:
        return SKIPPED
    return HELD if outcome["exit_status"] == 0 else FAILED


def counts_of(outcomes: Iterable[Outcome]) -> dict[str, int]:
    """How many there are of each status."""
    return dict(Counter(status_of(outcome) for outcome in outcomes))


def header(version: str, cases: int, at_once: int) -> str:
    """The first line."""
    beside = f", {at_once} at a time" if at_once > 1 else ""
    return f"fleetloop {version}: {cases} scenario{'s' * (cases != 1)}{beside}"


class Listing:
    """Prints what comes; with `quiet` the end only."""

    def __init__(self, sources: Sequence[str], overrides: Sequence[str], *, quiet: bool) -> None:
        self._all, self._done = len(sources), 0
        self._width = min(max(map(len, sources), default=0), 60)
        self._overrides = overrides
        self._quiet = quiet

    def show(self, source: str, outcome: Outcome) -> None:
        """Print the line of one scenario."""
        self._done += 1
        if self._quiet:
            return
        status = status_of(outcome)
        word = status if status in (HELD, SKIPPED) else status.upper()
        expected = len(outcome["expectations"])
        about = f"{expected} expectation{'s' * (expected != 1)}, {outcome['took_s']:.1f} s"
        percent = 100 * self._done // self._all
        say(f"{source:<{self._width}}  {word:<7}  [{percent:3d}%]  {about}")

    def end(self, outcomes: Mapping[str, Outcome], took_s: float) -> None:
        """Print what failed, and the counts."""
        wrong = {s: o for s, o in outcomes.items() if status_of(o) in BAD}
        if wrong:
            say(_ruled("failures", "="))
        for source, outcome in wrong.items():
            say(_ruled(source, "_"))
            for line in account(source, outcome, self._overrides):
                say(line)
        counts = counts_of(outcomes.values())
        said = ", ".join(f"{counts[status]} {status}" for status in _ORDER if status in counts)
        say(_ruled(f"{said or 'no scenarios'} in {took_s:.1f} s", "="))


def account(source: str, outcome: Outcome, overrides: Sequence[str] = ()) -> list[str]:
    """What is wrong with a scenario's outcome, and the command that runs it again."""
    lines = wrong_lines(outcome)
    lines.append(f"again   {command(source, outcome, overrides)}")
    if outcome["folder"]:
        lines.append(f"run     {outcome['folder']}")
    return lines


def command(source: str, outcome: Outcome, overrides: Sequence[str] = ()) -> str:
    """The command that runs a scenario as it ran; that checks it, if it was refused."""
    refused = outcome["verdict"] == REFUSED
    parts = ["fleetloop", "check" if refused else "run", source]
    if not (refused or outcome.get("processes")):
        parts.append("--in-process")
    for override in overrides:
        parts += ["--set", override]
    return shlex.join(parts)


def _ruled(text: str, rule: str) -> str:
    return f" {text} ".center(_WIDTH, rule)
