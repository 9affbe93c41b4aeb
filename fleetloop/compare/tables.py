"""The tables of a comparison, in the terminal and on the page: a row per law."""

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from rich.markup import escape
from rich.table import Table

from fleetloop.compare.measures import SPREAD, Measures
from fleetloop.compare.results import Row
from fleetloop.results.tables import number, settled_at, table_box
from fleetloop.settling import FINAL_S, SETTLE_BAND
from fleetloop.terminal import ResultConsole

NONE = "-"
_LONG = 1e5
"""A number beyond this, as of a law that diverged, is written with its power of ten."""


class Columns(NamedTuple):
    """A table: its title, and of each column the header and the cell of a row."""

    title: str
    columns: Sequence[tuple[str, Callable[[Row], str]]]

    def header(self) -> list[str]:
        """Headers, the law's first."""
        return ["law", *(header for header, _ in self.columns)]

    def rows(self, rows: Sequence[Row]) -> Iterator[list[str]]:
        """A row of cells per law."""
        for row in rows:
            yield [row.label, *(cell(row) for _, cell in self.columns)]


def _cell(of: Callable[[Measures], str]) -> Callable[[Row], str]:
    """A cell of a row's worst numbers."""

    def cell(row: Row) -> str:
        return NONE if row.worst is None else of(row.worst)

    return cell


def _settled(name: str) -> Callable[[Row], str]:
    return _cell(lambda found: settled_at(found["settle_s"][name]))


def _of(group: str, name: str, spec: str, scale: float = 1.0) -> Callable[[Row], str]:
    return _cell(lambda found: _scaled(found[group][name], spec, scale))


def _scaled(value: float | None, spec: str, scale: float = 1.0) -> str:
    scaled = None if value is None else scale * value
    return number(scaled, ".3g" if scaled is not None and abs(scaled) >= _LONG else spec)


def _learnt(row: Row) -> str:
    """How far Θ̂ was off at the start and at the end."""
    found = None if row.worst is None else row.worst["theta_hat_error"]
    if found is None:
        return NONE
    return f"{_scaled(found['start'], '.0f', 100)} → {_scaled(found['end'], '.0f', 100)} %"


def _expected(row: Row) -> str:
    judged = row.expectations
    if None in judged:
        return "not reached"
    return f"{sum(map(bool, judged))} of {len(judged)}" if judged else NONE


def _us(row: Row) -> str:
    return NONE if row.cost is None else f"{row.cost.us:.1f}"


def _ratio(row: Row) -> str:
    return NONE if row.cost is None else f"{row.cost.ratio:.2f}"


FOLLOWING = Columns(
    "Path following",
    (
        ("x_e settled", _settled("x_e_m")),
        ("y_e settled", _settled("y_e_m")),
        ("θ_e settled", _settled("theta_e_rad")),
        ("spread settled", _settled(SPREAD)),
        ("rms [m]", _cell(lambda found: _scaled(found["position_rms_m"], ".3f"))),
        ("final rms [mm]", _cell(lambda found: _scaled(found["final_position_rms_m"], ".3f", 1e3))),
        ("final x_e [mm]", _of("final_max", "x_e_m", ".3f", 1e3)),
        ("final y_e [mm]", _of("final_max", "y_e_m", ".3f", 1e3)),
        ("final θ_e [mrad]", _of("final_max", "theta_e_rad", ".3f", 1e3)),
        ("expected held", _expected),
    ),
)
EFFORT = Columns(
    "Effort",
    (
        ("τ peak [N·m]", _of("torque_wheel_N_m", "peak", ".2f")),
        ("τ rms [N·m]", _of("torque_wheel_N_m", "rms", ".3f")),
        ("final τ rms [N·m]", _of("torque_wheel_N_m", "final_rms", ".3f")),
        ("final τ change [N·m/tick]", _of("torque_wheel_N_m", "final_change_rms", ".2e")),
        ("Θ̂ off by", _learnt),
        ("step [µs]", _us),
        ("step, × first", _ratio),
    ),
)
TABLES = (FOLLOWING, EFFORT)


def notes(seeds: Sequence[int]) -> list[str]:
    """What the columns are."""
    worst = f", the worst of seeds {', '.join(map(str, seeds))}" if len(seeds) > 1 else ""
    return [
        f"settled: within ±{SETTLE_BAND:g} from then on, all robots; final: the last {FINAL_S:g} s,"
        f" or all of a shorter run, greatest magnitude of any robot or, rms, over all{worst}",
        "rms of the position error hypot(x_e, y_e) and of the wheels' torque over the whole run;"
        " change: rms from tick to tick",
        "Θ̂ off by: ‖Θ̂ − Θ‖ / ‖Θ‖ at start and end, the worst robot; step: processor time of the"
        " law alone, the same motions to all in turn; × first: in the first law that came through",
    ]


def print_tables(title: str, rows: Sequence[Row], seeds: Sequence[int]) -> None:
    """Print the tables, and what happened to laws that didn't come through."""
    console = ResultConsole(file=sys.stdout, highlight=False)
    for columns in TABLES:
        table = Table(
            title=f"{title}: {columns.title.lower()}",
            box=table_box(),
            padding=(0, 1, 0, 0),
            pad_edge=False,
        )
        first, *others = columns.header()
        table.add_column(first, no_wrap=True)
        for header in others:
            words = header.rsplit(" ", 1)
            table.add_column(escape("\n".join(words)), justify="right", no_wrap=True)
        for cells in columns.rows(rows):
            table.add_row(*map(escape, cells))
        console.print_whole(table)
    for text in (*notes(seeds), *trouble_lines(rows)):
        console.print(text, soft_wrap=True, markup=False)


def trouble_lines(rows: Sequence[Row]) -> Iterator[str]:
    """Laws whose robots stopped, or whose runs ended early, and why."""
    for row in rows:
        if row.troubles:
            first, *others = row.troubles
            more = f"; {len(others)} more in compare.json" if others else ""
            yield f"STOPPED {row.label}: {first}{more}"
