"""The results of a run as the operator sees them."""

import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from fleetloop.summary import ERRORS, Summary

_MARKS = {True: "held   ", False: "FAILED ", None: "not reached"}
_UNITS = {"x_e_m": "x_e [m]", "y_e_m": "y_e [m]", "theta_e_rad": "θ_e [rad]"}


def print_results(summary: Summary, folder: Path) -> None:
    """Print the table of a run, its verdict, and where its files are."""
    console = Console(file=sys.stdout, highlight=False)
    if summary["robots"]:
        console.print(_robots(summary))
        spread = summary["s_spread"]
        console.print(
            f"spread of s: peak {spread['peak']:.4f} m, settled {_time(spread['settle_s'])},"
            f" final {spread['final']:.2e} m"
        )
    for expect in summary["expectations"]:
        console.print(f"{_MARKS[expect['held']]}  {_claim(expect)}")
    for robot, reason in summary["stopped_robots"].items():
        console.print(f"STOPPED {robot}: {reason}")
    if summary["real_time_factor"] is not None:
        console.print(
            f"{summary['ticks']} ticks in {summary['wall_s']:.2f} s:"
            f" {summary['real_time_factor']:.2f} × real time"
            f" (start {summary['startup_s']:.2f} s, end {summary['teardown_s']:.2f} s,"
            f" overruns {summary['overruns']})"
        )
    reason = f": {summary['reason']}" if summary["reason"] else ""
    console.print(f"verdict  {summary['verdict']}{reason}", style="bold", soft_wrap=True)
    console.print(f"run      {folder}", soft_wrap=True)
    if (folder / "report.html").exists():
        console.print(f"report   {folder / 'report.html'}", soft_wrap=True)
        console.print(f"figures  {folder / 'figures'}", soft_wrap=True)


def _robots(summary: Summary) -> Table:
    table = Table(title=f"{summary['scenario']}: path following, {summary['mode']}")
    table.add_column("robot")
    for name in ERRORS:
        table.add_column(f"{_UNITS[name].split()[0]} settled", justify="right")
    for name in ERRORS:
        table.add_column(f"final {_UNITS[name]}", justify="right")
    table.add_column("peak torque [N·m]", justify="right")
    for robot, values in summary["robots"].items():
        table.add_row(robot, *_cells(values))
    if len(summary["robots"]) > 1:
        table.add_section()
        table.add_row("worst", *_cells(summary["worst"]))
    return table


def _cells(values: dict[str, Any]) -> list[str]:
    settles = [_time(values["settle_s"][name]) for name in ERRORS]
    finals = [f"{values['final_max'][name]:.5f}" for name in ERRORS]
    return [*settles, *finals, f"{values['peak_torque_Nm']:.2f}"]


def _time(value: float | None) -> str:
    return "not" if value is None else f"{value:.2f} s"


def _claim(expect: dict[str, Any]) -> str:
    bounds = [f"{k} {expect[k]:g}" for k in ("max_abs", "min", "max") if k in expect]
    until = f" to {expect['to_s']:g} s" if "to_s" in expect else ""
    found = expect["found"]
    shown = "nothing: the run ended before"
    if found is not None:
        shown = ", ".join(f"{k} {found[k]:.3g}" for k in ("max_abs", "min", "max") if k in expect)
    robots = f" of {', '.join(expect['robots'])}" if "robots" in expect else ""
    return (
        f"{expect['signal']}{robots} from {expect['from_s']:g} s{until}:"
        f" {', '.join(bounds)}; found {shown}"
    )
