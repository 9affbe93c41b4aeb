"""`Run`: what a run left, by names: signals as arrays, events, expectations, verdict.

    run.t_s                  (ticks,)          scenario time of every tick [s]
    run["r1"].x_m            (ticks,)          a signal of a robot
    run.signal("x_e_m")      (ticks, robots)   of all robots, in the order of `run.robots`
    run.signal("s_spread")   (ticks,)          a derived signal of the fleet

Names and units are the record's (`run.signals`); NaN stands where a robot has no row.
"""

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from configs.errors import ScenarioError
from configs.scenario import Scenario
from configs.signals import Signal
from fleetloop.api import shown, table
from fleetloop.api.signals import Floats, RobotSignals, Signals
from fleetloop.launch.run import exit_status
from fleetloop.record.reader import Record
from fleetloop.record.scan import RecordError
from fleetloop.results import run_folder
from fleetloop.results.known import known_of
from fleetloop.results.summary import to_json
from fleetloop.results.summary_file import Event, Expectation, Fault, RunSummary
from fleetloop.results.tables import wrong_lines

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure
    from rich.console import RenderableType


class NotHeldError(AssertionError):
    """An expectation of a run did not hold, or was not reached; the text says which and where."""


class Run:
    """A run that has ended.

    Args:
        folder: of the run, or its record.
        partial: whether a record that is cut, or damaged, will do up to there.
        notes: what there was to mind before the run.

    Raises:
        ScenarioError: no record there, a damaged one, or not one tick in it.
        IncompleteError: the record isn't all there, and that won't do.
    """

    folder: Path
    notes: tuple[str, ...]
    """What `fleetloop check` had to say before the run; of a folder that is read nothing."""

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        partial: bool = False,
        notes: Sequence[str] = (),
    ) -> None:
        path = run_folder.record_of(Path(folder))
        try:
            record = Record.open(path, damaged=partial)
        except RecordError as error:
            raise ScenarioError(str(error).replace("--partial", "partial=True")) from error
        if record.lost and not partial:
            raise run_folder.IncompleteError(
                f"{path}: {record.shortage()}; partial=True takes that"
            )
        self._record, self._scenario, self._summary = known_of(record)
        self._signals = Signals(self._record, self._scenario)
        self.folder, self.notes = path.parent, tuple(notes)

    # --- what it was and what it came to ----------------------------------------------------------

    @property
    def scenario(self) -> Scenario:
        """The scenario that ran, all defaults written out."""
        return self._scenario

    @property
    def robots(self) -> tuple[str, ...]:
        """Names, in the order of the scenario."""
        return self._record.robots

    @property
    def verdict(self) -> str:
        """One of held, failed, not checked, aborted, interrupted."""
        return str(self._summary["verdict"])

    @property
    def held(self) -> bool:
        """Whether all that the scenario expects was seen to hold."""
        return self.verdict == "held"

    @cached_property
    def summary(self) -> RunSummary:
        """summary.json, typed: settle times, final errors, spread, cost of the run."""
        return RunSummary.model_validate_json(to_json(self._summary))

    @property
    def expectations(self) -> tuple[Expectation, ...]:
        """What was expected: claim, whether it held, worst tick and robot, margin."""
        return tuple(self.summary.expectations)

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened, by tick."""
        return tuple(self.summary.events)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults of the run, the scenario's and those that were ordered."""
        return tuple(self.summary.faults)

    @property
    def why(self) -> str:
        """What did not hold, where and by how much, and what went wrong; "" if nothing did."""
        return "\n".join(wrong_lines(self._summary))

    def raise_for_verdict(self, *, allow_unchecked: bool = False) -> "Run":
        """Return this run if it held, or expects nothing and came to its end.

        Args:
            allow_unchecked: whether it may have ended before the time of an expectation.

        Raises:
            NotHeldError: it did not; the text is `why`.
        """
        if exit_status(self._summary, allow_unchecked=allow_unchecked):
            raise NotHeldError(f"{self.scenario.name}: {self.verdict}\n{self.why}".rstrip())
        return self

    # --- signals ----------------------------------------------------------------------------------

    @property
    def t_s(self) -> Floats:
        """Scenario time of every tick [s]."""
        return self._signals.t_s

    @property
    def signals(self) -> Mapping[str, Signal]:
        """Every signal of any robot and every derived one: name, unit, meaning."""
        return self._signals.table

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Units by the names of signals; "1" without one."""
        return {name: signal.unit for name, signal in self.signals.items()}

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """All pairs of robots: the columns of `signal("robot_distance_m")`."""
        return self._signals.pairs

    def signal(self, name: str) -> Floats:
        """A signal of all robots, (ticks, robots), in the order of `robots`.

        `s_spread` is the fleet's, (ticks,); `robot_distance_m` has a column for each of `pairs`.
        A robot whose law doesn't have the signal has NaN.

        Raises:
            KeyError: no robot has it.
        """
        return self._signals.of_all(name)

    def __getitem__(self, robot: str) -> RobotSignals:
        if robot not in self.robots:
            raise KeyError(f"no robot {robot!r} in this run; there are {', '.join(self.robots)}")
        return RobotSignals(self._signals, robot)

    def __iter__(self) -> Iterator[str]:
        return iter(self.robots)

    def __contains__(self, robot: object) -> bool:
        return robot in self.robots

    # --- elsewhere --------------------------------------------------------------------------------

    def to_pandas(
        self, signals: Sequence[str] | None = None, *, robots: Sequence[str] | None = None
    ) -> "pd.DataFrame":
        """A row per tick and robot: `t_s`, `robot` (categorical), and signals; by tick, then robot.

        Units are in `attrs["units"]`.

        Args:
            signals: recorded ones by name; None: all.
            robots: only these.

        Raises:
            ScenarioError: no such signal or robot.
            ImportError: pandas isn't installed; the text says what to install.
        """
        return table.to_pandas(self._record, self.units, signals, robots)

    def to_arrow(
        self, signals: Sequence[str] | None = None, *, robots: Sequence[str] | None = None
    ) -> "pa.Table":
        """The same as an Arrow table; unit and meaning are in each field's metadata.

        Raises:
            ScenarioError: no such signal or robot.
            ImportError: pyarrow isn't installed; the text says what to install.
        """
        return table.to_arrow(self._record, self.signals, signals, robots)

    def to_parquet(
        self,
        path: str | os.PathLike[str],
        signals: Sequence[str] | None = None,
        *,
        robots: Sequence[str] | None = None,
    ) -> Path:
        """Write the same as a Parquet file; return its path.

        Raises:
            ScenarioError: no such signal or robot.
            InfrastructureError: it can't be written.
            ImportError: pyarrow isn't installed; the text says what to install.
        """
        return table.write_parquet(self.to_arrow(signals, robots=robots), Path(path))

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """All signals for polars, DuckDB and others: `polars.DataFrame(run)`."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def save(self, folder: str | os.PathLike[str]) -> "Run":
        """Copy the run's folder, as that of a temporary run; return the run there.

        Raises:
            ScenarioError: the folder exists.
        """
        target = Path(folder)
        if target.exists():
            raise ScenarioError(f"{target}: exists; name a new folder")
        shutil.copytree(self.folder, target)
        return Run(target, partial=True, notes=self.notes)

    # --- to be looked at --------------------------------------------------------------------------

    def figures(self) -> "Mapping[str, Figure]":
        """Every figure of the report, by name."""
        from fleetloop.api import plots

        return plots.all_of(self._record, self._scenario, self._summary)

    def plot_graph(self) -> "Figure":
        """The directed graph."""
        return self._plot("graph")

    def plot_positions(self) -> "Figure":
        """Tracks in the plane with headings, over the reference paths."""
        return self._plot("positions")

    def plot_errors(self, signal: str = "x_e_m") -> "Figure":
        """One of the path following errors (8) of every robot over time."""
        return self._plot(signal)

    def plot_path_variables(self) -> "Figure":
        """The path variables s."""
        return self._plot("path_variables")

    def plot_parameter_errors(self) -> "Figure":
        """The differences of path variables over the edges."""
        return self._plot("parameter_errors")

    def plot_speed_estimates(self) -> "Figure":
        """The estimates of the reference speed, (38)."""
        return self._plot("speed_estimates")

    def plot_torques(self) -> "Figure":
        """The commanded wheel torques."""
        return self._plot("torques")

    def plot_law_signals(self) -> "Figure":
        """What the laws record of themselves."""
        return self._plot("law_signals")

    def _plot(self, name: str) -> "Figure":
        from fleetloop.api import plots

        return plots.draw(name, self._record, self._scenario)

    def __repr__(self) -> str:
        names = f"{len(self.robots)} robots, {len(self.t_s)} ticks"
        return f"<Run {self.scenario.name}: {self.verdict}, {names}, {self.folder}>"

    def _repr_html_(self) -> str:
        return shown.html(self._summary, self.notes)

    def __rich__(self) -> "RenderableType":
        return shown.renderable(self._summary)
