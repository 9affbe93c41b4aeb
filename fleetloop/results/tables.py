"""The results of a run as tables, in the terminal and on the page."""

import sys
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from bridge.process.profile import PARTS
from configs import compiled
from configs.roles import short_name
from fleetloop.results.summary import ERRORS, Summary
from fleetloop.settling import FINAL_S
from fleetloop.terminal import ResultConsole, say

_MARKS = {True: "held", False: "FAILED", None: "not reached"}
_RULE = box.Box("    \n    \n -- \n    \n    \n    \n    \n    \n", ascii=True)
"""`box.SIMPLE_HEAD` in ASCII."""
HOLDS_PERCENT = 2.0
"""More misses than this, and the machine is said not to hold the rate."""
MOST_EDGES = 8
"""Of which lines tell; summary.json has all."""
EARLY_S = 0.05
"""A robot whose rows end so long before the run's took part in a part of it [s]."""
UNSETTLED = "not settled"
_SYMBOLS = {"x_e_m": ("x_e", "m"), "y_e_m": ("y_e", "m"), "theta_e_rad": ("θ_e", "rad")}


def print_results(summary: Summary, folder: Path) -> None:
    """Print the table of a run, its verdict, and where its files are."""
    console = ResultConsole(file=sys.stdout, highlight=False)

    def line(text: str, style: str | None = None) -> None:
        console.print(text, style=style, soft_wrap=True, markup=False)

    if summary["robots"]:
        title = f"{summary['scenario']}: path following, {summary['mode']}"
        table = Table(title=title, box=table_box(), padding=(0, 1, 0, 0), pad_edge=False)
        first, *others = robot_header(break_lines=True)
        table.add_column(first, no_wrap=True)
        for header in others:
            table.add_column(escape(header), justify="right", no_wrap=True)
        for row in robot_rows(summary):
            if row[0] == "worst":
                table.add_section()
            table.add_row(*row)
        console.print_whole(table)
        line(final_line(summary))
        line(spread_line(summary))
    for expect in summary["expectations"]:
        line(f"{mark(expect):<11}  {claim(expect)}")
    for text in trouble_lines(summary):
        line(text)
    if summary["real_time_factor"] is not None:
        line(
            f"{summary['ticks']} ticks in {summary['wall_s']:.2f} s:"
            f" {summary['real_time_factor']:.2f} × real time"
            f" (start {summary['startup_s']:.2f} s, end {summary['teardown_s']:.2f} s,"
            f" overruns {summary['overruns']})"
        )
    if summary["profile_us_per_tick"]:
        console.print_whole(_profile(summary["profile_us_per_tick"]))
    for text in (*network_lines(summary), *realtime_lines(summary)):
        line(text)
    line(f"verdict  {_with_reason(summary['verdict'], summary['reason'])}", "bold")
    line(f"run      {folder}")


def print_report(page: Path) -> None:
    """Say where the page of a run is, and its figures."""
    say(f"report   {page}\nfigures  {page.parent / 'figures'}")


def _profile(profile: dict[str, dict[str, float]]) -> Table:
    """Processor time per tick, processes by parts."""
    parts = [part for part in PARTS if any(part in shares for shares in profile.values())]
    title = "processor time per tick [µs]; bus with its system calls, Zenoh with its threads; "
    title += compiled.how()
    table = Table(title=title, box=table_box(), pad_edge=False)
    table.add_column("process", no_wrap=True)
    for name in (*parts, "all"):
        table.add_column(name, justify="right")
    for process, shares in profile.items():
        values = [shares.get(part, 0.0) for part in parts]
        table.add_row(process, *(f"{v:.1f}" for v in (*values, sum(values))))
    table.add_section()
    totals = [sum(shares.get(part, 0.0) for shares in profile.values()) for part in parts]
    table.add_row("all", *(f"{v:.1f}" for v in (*totals, sum(totals))))
    return table


def robot_header(*, break_lines: bool = False) -> list[str]:
    """Headers of `robot_rows`."""
    gap = "\n" if break_lines else " "
    settled = [f"{_SYMBOLS[name][0]}{gap}settled" for name in ERRORS]
    final = [f"{_SYMBOLS[name][0]} [{_SYMBOLS[name][1]}]{gap}final" for name in ERRORS]
    return ["robot", *settled, *final, f"τ [N·m]{gap}peak"]


def robot_rows(summary: Summary) -> Iterator[list[str]]:
    """A row per robot, with its end if it was early; with several robots a last one, worst."""
    for robot, values in summary["robots"].items():
        yield [robot + _early(summary, values, " to"), *_cells(values)]
    if len(summary["robots"]) > 1:
        yield ["worst", *_cells(summary["worst"])]


def final_line(summary: Summary) -> str:
    """The window of final errors, in words."""
    return f"final: greatest magnitude in the last {min(FINAL_S, summary['simulated_s']):g} s"


def spread_line(summary: Summary) -> str:
    """The spread of the path variables in one line; it ends where a member's rows end."""
    spread = summary["s_spread"]
    if spread is None or not summary["robots"]:
        return ""
    robots = summary["robots"].values()
    stayed = [robot for robot in robots if robot.get("left_s") is None] or robots
    first = min(stayed, key=lambda robot: robot["ticks"])
    return (
        f"spread of s{_early(summary, first, ' up to')}: peak {number(spread['peak'], '.4f')} m,"
        f" settled {settled_at(spread['settle_s'])},"
        f" final {number(spread['final'], '.2e')} m"
    )


def _early(summary: Summary, robot: dict[str, Any], word: str) -> str:
    """When a robot ended that ended well before the run did, after a word; else nothing."""
    period_s = float(summary["simulated_s"]) / max(1, summary["ticks"])
    left_s = period_s * (int(summary["ticks"]) - int(robot["ticks"]))
    return f"{word} {period_s * int(robot['ticks']):.6g} s" if left_s > EARLY_S else ""


_ENDS = ("stopped", "diverged")
"""Kinds of events whose text is the reason of a robot that ended stopped."""


def trouble_lines(summary: Summary) -> Iterator[str]:
    """Robots that stopped themselves, what led to it, and buses that failed at times."""
    for robot, reason in summary["stopped_robots"].items():
        yield f"STOPPED {robot}: {reason}"
    for robot, notices in summary["notices"].items():
        told = summary["stopped_robots"].get(robot)
        for notice in notices:
            if told not in (notice.replace(f"{kind}: ", "", 1) for kind in _ENDS):
                yield f"{robot}: {notice}"
    for bus, trouble in summary["bus_troubles"].items():
        yield f"BUS {bus}: {trouble}"
    if summary["record_lost"]:
        yield f"RECORD not all there: {summary['record_lost']}"
    for robot, how in summary["cut_short"].items():
        yield f"{robot}: {how}"
    yield from machine_lines(summary)


def wrong_lines(outcome: dict[str, Any]) -> list[str]:
    """What is wrong with the outcome of a run: why there is no verdict, what did not hold, why."""
    lines = []
    if outcome["verdict"] not in ("held", "failed"):
        lines.append(_with_reason(outcome["verdict"], outcome["reason"]))
    broken = [expect for expect in outcome["expectations"] if expect["held"] is not True]
    lines += [f"{mark(expect):<11}  {claim(expect)}" for expect in broken]
    if "stopped_robots" in outcome:
        lines += trouble_lines(outcome)
    return lines


def _with_reason(verdict: str, reason: str) -> str:
    """A verdict and why; said once of a run that was "interrupted by SIGINT"."""
    if reason.startswith(verdict):
        return reason
    return f"{verdict}: {reason}" if reason else verdict


def machine_lines(summary: Summary) -> Iterator[str]:
    """Stalls of launcher and plant; empty without any, or without a watch."""
    machine = {"stalls": 0, **(summary["machine"] or {})}
    if machine["stalls"]:
        stops = machine["stopped_and_continued"]
        yield (
            f"MACHINE stalled {machine['stalls']} times, {machine['stalled_s']:.2f} s in all,"
            f" longest {machine['longest_stall_s']:.2f} s at"
            f" t = {machine['longest_stall_at_s']:.2f} s"
            + (f"; {stops} of them stopped by Ctrl-Z or a signal" if stops else "")
        )
    if stalls := machine.get("plant_stalls"):
        worst = max(stalls, key=lambda stall: stall["lasted_s"])
        yield (
            f"PLANT, or its machine, stalled {len(stalls)} times, longest {worst['lasted_s']:.2f} s"
            f" at t = {worst['t_s']:.2f} s"
        )


def network_lines(summary: Summary) -> Iterator[str]:
    """What the edges did, those with the oldest data first; nothing if it wasn't recorded."""
    edges = summary.get("network") or {}

    def oldest(edge: str) -> float:
        return float((edges[edge].get("age_s") or {"max": -1.0})["max"])

    order = sorted(edges, key=oldest, reverse=True)
    for edge in order[:MOST_EDGES]:
        counts, age = edges[edge], edges[edge].get("age_s")
        said = []
        if sent := counts.get("sent"):
            said = [f"{sent} sent, {counts.get('delivered', 0)} delivered"]
        rare = ("lost", "duplicated", "reordered", "late")
        said += [f"{counts[fate]} {fate}" for fate in rare if counts.get(fate)]
        if age is not None:
            said += [f"age {age['mean']:.3g} s, p99 {age['p99']:.3g} s, max {age['max']:.3g} s"]
        yield f"{edge}: {', '.join(said) or 'nothing heard'}"
    if len(order) > MOST_EDGES:
        yield f"and {len(order) - MOST_EDGES} more edges in summary.json"


def realtime_lines(summary: Summary) -> Iterator[str]:
    """How well the wall clock was kept, and what would help; nothing for a lockstep run."""
    kept = summary.get("realtime")
    if not kept:
        return
    late, trip = kept["late_us"], kept["round_trip_us"]
    yield (
        f"real time: misses {kept['miss_percent']:g} %, wake-up late p50 {late.get('p50', 0):.0f}"
        f" p99 {late.get('p99', 0):.0f} max {late.get('max', 0):.0f} µs, torque to feedback p50"
        f" {trip.get('p50', 0):.0f} p99 {trip.get('p99', 0):.0f} max {trip.get('max', 0):.0f} µs,"
        f" processor {kept['cpu_percent_of_one_core']:g} % of one core"
    )
    for process, offset in summary.get("clock_offsets", {}).items():
        yield (
            f"clock of {short_name(process)}: {offset['ahead_ms']:+.3g} ms"
            f" (± {offset['uncertain_ms']:.2g} ms), drift {offset['drift_ms']:+.2g} ms"
        )
    if kept["missing_privileges"]:
        missing = ", ".join(kept["missing_privileges"])
        yield f"note: this user lacks privileges, so the clock jitters more: {missing}"
    if kept["miss_percent"] > HOLDS_PERCENT:
        yield (
            f"WARNING: this machine does not hold the rate: {kept['miss_percent']:g} % of the ticks"
            " had no feedback in time; lower the rate or free the machine"
        )


def mark(expect: dict[str, Any]) -> str:
    """Whether an expectation held."""
    return _MARKS[expect["held"]]


def claim(expect: dict[str, Any]) -> str:
    """An expectation and its result, in one line."""
    return f"{label(expect)}: {finding(expect)}"


def marked_claim(expect: dict[str, Any]) -> str:
    """The same with the word whether it held before it."""
    return f"{mark(expect)}: {claim(expect)}"


def label(expect: dict[str, Any]) -> str:
    """What an expectation says, behind its name if it has one."""
    name = expect.get("name")
    return f"{name}: {expect['claim']}" if name else str(expect["claim"])


def finding(expect: dict[str, Any]) -> str:
    """The result of an expectation: value, where and when, and the margin."""
    value = found_value(expect)
    shown = value if value == UNSETTLED else f"found {value}"
    if place := worst_place(expect):
        shown += f" {place}"
    if least := margin(expect):
        shown += f", margin {least}"
    if expect["held"] is None:
        shown += f"; seen to {expect['seen_to_s']:.6g} s only"
    return shown


def found_value(expect: dict[str, Any]) -> str:
    """The value of an expectation, in words if it has none."""
    if expect["worst"] is None and expect["value"] is None:
        return "nothing"
    if expect["value"] is None and "settle_within_s" in (expect["bound"] or ()):
        return UNSETTLED
    return f"{number(expect['value'], '.3g')}{_unit(expect)}"


def worst_place(expect: dict[str, Any]) -> str:
    """Robots and time of the worst tick, as far as there is one."""
    worst = expect["worst"]
    if worst is None:
        return ""
    robots = f"({', '.join(worst['robots'])})" if worst["robots"] else ""
    at = "" if worst["t_s"] is None else f"at {worst['t_s']:.6g} s"
    return " ".join(filter(None, (robots, at)))


def margin(expect: dict[str, Any]) -> str:
    """The margin with its sign and unit; nothing without one."""
    if expect["margin"] is None or not isfinite(expect["margin"]):
        return ""
    return f"{number(expect['margin'], '+.2g')}{_unit(expect)}"


def _unit(expect: dict[str, Any]) -> str:
    return f" {expect['unit']}" if expect["unit"] not in ("", "1") else ""


def _cells(values: dict[str, Any]) -> list[str]:
    settles = [settled_at(values["settle_s"][name]) for name in ERRORS]
    finals = [number(values["final_max"][name], ".5f") for name in ERRORS]
    return [*settles, *finals, number(values["peak_torque_wheel_N_m"], ".2f")]


def number(value: float | None, spec: str) -> str:
    """A number, or that it is none: of what a law that diverged says nothing is known."""
    return "no number" if value is None or not isfinite(value) else format(value, spec)


def settled_at(value: float | None) -> str:
    """A settle time; None is never."""
    return "never" if value is None else f"{value:.2f} s"


def table_box() -> box.Box:
    """The rules of a table, as far as standard output has the characters."""
    return _RULE if ResultConsole().options.ascii_only else box.SIMPLE_HEAD
