"""`summary.json` read back and validated, as far as the page shows it.

Keys that aren't named here may be there, too. What `fleetloop.results.summary` makes fits; a number
that was none, as after a law that diverged, is null.
"""

import json
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, model_validator

from configs.errors import ScenarioError
from fleetloop.results.run_folder import SUMMARY
from fleetloop.results.summary import ERRORS, Summary


def _of_every_error(values: dict[str, Any]) -> dict[str, Any]:
    if missing := [name for name in ERRORS if name not in values]:
        raise ValueError(f"no {', '.join(missing)}")
    return values


class _Table(BaseModel):
    """Keys that aren't named here are attributes, too."""

    model_config = ConfigDict(frozen=True, extra="allow")


class Worst(_Table):
    """Of a robot, or the worst of all: settle times [s], greatest errors at the end, torque."""

    settle_s: Annotated[dict[str, float | None], AfterValidator(_of_every_error)]
    final_max: Annotated[dict[str, float | None], AfterValidator(_of_every_error)]
    peak_torque_wheel_N_m: float | None


class RobotSummary(Worst):
    """Of one robot."""

    ticks: int
    settle_s_dot_s: float | None
    joined_s: float = 0.0
    left_s: float | None = None


class Spread(_Table):
    """Of the path variables, max − min over the robots [m]."""

    peak: float | None
    settle_s: float | None
    final: float | None


class Place(_Table):
    """Where something was at its worst."""

    robots: list[str]
    t_s: float | None


class Extent(_Table):
    """The window of an expectation [s]."""

    from_s: float
    to_s: float


class Expectation(_Table):
    """What was expected, and what was found."""

    signal: str | None = None
    robots: list[str] | None = None
    max_abs: float | None = None
    min: float | None = None
    max: float | None = None
    settle_within_s: float | None = None
    window: Extent | None = None
    name: str | None = None
    claim: str
    held: bool | None
    value: float | None
    worst: Place | None
    bound: dict[str, float] | None
    margin: float | None
    unit: str
    seen_to_s: float | None = None

    @model_validator(mode="after")
    def _says_how_far_it_was_seen(self) -> Self:
        if self.held is None and self.seen_to_s is None:
            raise ValueError("neither held nor seen up to some time")
        return self


class Age(_Table):
    """Age of what an edge gave [s]."""

    mean: float
    p99: float
    max: float


class EdgeSummary(_Table):
    """Counts of an emulated edge; the age where it is recorded."""

    sent: int = 0
    delivered: int = 0
    lost: int = 0
    duplicated: int = 0
    reordered: int = 0
    late: int = 0
    age_s: Age | None = None


class RealtimeSummary(_Table):
    """How well the wall clock was kept."""

    miss_percent: float
    late_us: dict[str, float]
    round_trip_us: dict[str, float]
    cpu_percent_of_one_core: float
    missing_privileges: list[str]


class ClockOffset(_Table):
    """Of another machine."""

    ahead_ms: float
    uncertain_ms: float
    drift_ms: float


class Fault(_Table):
    """A fault of the scenario, or one that was ordered."""

    name: str
    kind: str
    targets: list[str]
    parameters: dict[str, Any]
    ordered: bool
    state: str
    from_tick: int
    from_s: float
    to_tick: int | None
    to_s: float | None


class Event(_Table):
    """What happened, at scenario time `t_s`."""

    t_s: float
    source: str
    kind: str
    text: str


class Stall(_Table):
    """A standstill."""

    t_s: float
    lasted_s: float


class MachineSummary(_Table):
    """Of the launcher's view all is there or nothing."""

    stalls: int = 0
    stalled_s: float | None = None
    longest_stall_s: float | None = None
    longest_stall_at_s: float | None = None
    stopped_and_continued: int | None = None
    plant_stalls: list[Stall] = []

    @model_validator(mode="after")
    def _tells_of_its_stalls(self) -> Self:
        if self.stalls and None in (
            self.stalled_s,
            self.longest_stall_s,
            self.longest_stall_at_s,
            self.stopped_and_continued,
        ):
            raise ValueError("stalls without how long and when")
        return self


class RunSummary(_Table):
    """summary.json."""

    verdict: str
    reason: str
    scenario: str
    mode: str
    started: str
    ticks: int
    simulated_s: float
    wall_s: float
    real_time_factor: float | None
    startup_s: float
    teardown_s: float
    robots: dict[str, RobotSummary]
    worst: Worst | None
    s_spread: Spread | None
    expectations: list[Expectation]
    cut_short: dict[str, str]
    record_lost: str
    stopped_robots: dict[str, str]
    notices: dict[str, list[str]]
    faults: list[Fault] = []
    events: list[Event] = []
    network: dict[str, EdgeSummary] | None = None
    overruns: int
    frames_per_bus: dict[str, int]
    bus_troubles: dict[str, str]
    cpu_s: dict[str, float]
    realtime: RealtimeSummary | None
    clock_offsets: dict[str, ClockOffset] = {}
    machine: MachineSummary | None
    seed: int
    compiled: bool = False
    versions: dict[str, str]

    @model_validator(mode="after")
    def _names_the_worst(self) -> Self:
        if len(self.robots) > 1 and self.worst is None:
            raise ValueError("no worst of several robots")
        return self


def read_summary(folder: Path) -> Summary | None:
    """The summary in a run's folder, None if the run left none.

    Raises:
        ScenarioError: the file can't be read, or isn't a summary as this version writes it.
    """
    path = folder / SUMMARY
    try:
        summary = json.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ScenarioError(f"{path}: can't be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise _refusal(path, f"not JSON ({error})") from error
    if not isinstance(summary, dict):
        raise _refusal(path, "not an object of what a run came to")
    try:
        RunSummary.model_validate(summary, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "its robots"
        wrong = "missing" if first["type"] == "missing" else "not what a run leaves there"
        raise _refusal(path, f"{where} is {wrong}") from error
    return summary


def _refusal(path: Path, what: str) -> ScenarioError:
    return ScenarioError(
        f"{path}: {what}; without this file the page is made from the record alone"
    )
