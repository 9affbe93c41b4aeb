"""The outcome of a run as one JSON document, whatever the run came to.

    scenario      the name of the scenario, or what was given for it if it can't be read
    verdict       held, failed, not checked, aborted, interrupted; refused: nothing was started
    reason        in words; "" if there is none
    exit_status   of `fleetloop run`: see `configs.errors.ExitStatus`
    folder        of the run; null if there is none
    problems      of a scenario that was refused: where (file or option), key, value, remedy
    expectations  as in summary.json; empty if there was no run
    took_s        wall time from the start of the processes to their end [s]

A run that left a summary has the rest of summary.json beside these keys.
"""

import json
from pathlib import Path
from typing import Any

from configs.errors import Complaint, FleetloopError, ScenarioError
from fleetloop.results.summary import Summary, finite

Outcome = dict[str, Any]
REFUSED = "refused"


def of_summary(summary: Summary, folder: Path, exit_status: int) -> Outcome:
    """The outcome of a run that left a summary."""
    took_s = sum(summary[key] or 0.0 for key in ("startup_s", "wall_s", "teardown_s"))
    whole: Outcome = finite(
        {**summary, "exit_status": int(exit_status), "folder": str(folder), "problems": []}
    )
    return whole | {"took_s": round(took_s, 3)}


def of_error(scenario: str, error: FleetloopError) -> Outcome:
    """The outcome of a run that did not begin, or of which nothing is known."""
    problems = problems_of(error) if isinstance(error, ScenarioError) else []
    verdict = REFUSED if isinstance(error, ScenarioError) else "aborted"
    return unbegun(scenario, verdict, str(error), error.exit_status) | {"problems": problems}


def unbegun(scenario: str, verdict: str, reason: str, exit_status: int) -> Outcome:
    """The outcome of what left no summary."""
    return {
        "scenario": scenario,
        "verdict": verdict,
        "reason": reason,
        "exit_status": int(exit_status),
        "folder": None,
        "problems": [],
        "expectations": [],
        "took_s": 0.0,
    }


def problems_of(error: ScenarioError) -> list[dict[str, object]]:
    """Errors in a file or an option, for machines."""
    if error.complaints:
        return [
            {**complaint._asdict(), "value": _json_value(complaint.value)}
            for complaint in error.complaints
        ]
    return [Complaint("", "", None, text)._asdict() for text in str(error).splitlines()]


def _json_value(value: object) -> object:
    """As it is, if JSON has it; nan and infinity it has not."""
    try:
        return json.loads(json.dumps(value, allow_nan=False))
    except (TypeError, ValueError):
        return str(value)
