"""The sections of a page: errors, agreement, torques, drives, buses, ages, the clock, the laws."""

from collections.abc import Callable, Sequence

import numpy as np

from configs.errors import ScenarioError
from configs.signals import SPREAD, law_table
from fleetloop.results.decimation import Points, decimated
from fleetloop.results.derived import spread
from fleetloop.results.network import ages_of
from fleetloop.results.palette import ROBOTS, robot_style
from fleetloop.results.panel import Bound, Line, LineStyle, Panel, Section
from fleetloop.results.summary import leader_profile
from fleetloop.results.view import MOST_LINES, View, group_of, line, widest
from fleetloop.torque_limits import tightest

ERRORS = (("x_e_m", "xₑ", "m"), ("y_e_m", "yₑ", "m"), ("theta_e_rad", "θₑ", "rad"))
_LEADER = LineStyle("#7d7d7d", (4, 3))
_LAW_POINTS = 400
_RIGHT, _LEFT = LineStyle(ROBOTS[0]), LineStyle(ROBOTS[1])
_RIGHT_FELT, _LEFT_FELT = LineStyle(ROBOTS[5], (), 1.0), LineStyle(ROBOTS[4], (), 1.0)


def sections(view: View) -> list[Section]:
    """All of a run, without those that have nothing to show."""
    made = (make(view) for make in _SECTIONS)
    return [one for one in made if any(p.lines or p.bands for p in one.panels)]


def _errors(view: View) -> Section:
    panels = [view.panel(name, f"{symbol} [{unit}]", unit) for name, symbol, unit in ERRORS]
    note = "Path following errors, equation (8), seen from the robot. Dashed: what was expected."
    return Section("errors", "Errors", note, panels)


def _agreement(view: View) -> Section:
    note = "Differences of the path variables over the edges, sᵢ − sⱼ, and their spread."
    panels = [_differences(view), _spread(view), _speeds(view)]
    return Section("agreement", "Agreement", note, panels)


def _differences(view: View) -> Panel:
    panel = Panel("sᵢ − sⱼ over the edges [m]", "m")
    s = {robot: rows["s"] for robot, rows in view.record.controller.items()}
    t = max((rows["t_s"] for rows in view.record.controller.values()), key=len)
    edges = [
        (speaker, hearer)
        for speaker, hearer in view.scenario.topology.edges
        if len(s[speaker]) and len(s[hearer])
    ]
    values = {}
    for speaker, hearer in edges:
        both = min(len(s[hearer]), len(s[speaker]))
        values[speaker, hearer] = s[hearer][:both] - s[speaker][:both]
    if len(edges) > 2 * MOST_LINES:
        panel.bands += view.band({f"{a} → {b}": found for (a, b), found in values.items()})
    drawn = [edge for edge in edges if len(edges) <= 2 * MOST_LINES or edge[1] in view.robots]
    seen: dict[str, int] = {}
    for speaker, hearer in drawn:
        turn = seen[hearer] = seen.get(hearer, -1) + 1
        style = view.style(hearer)
        style = LineStyle(style.colour, robot_style(4 * turn).dash or style.dash)
        found = values[speaker, hearer]
        points = decimated(t[: len(found)], found, view.points(len(drawn)))
        panel.lines.append(Line(f"{hearer} − {speaker}", (group_of(hearer),), style, points))
    return panel


def _spread(view: View) -> Panel:
    panel = Panel("spread max s − min s [m]", "m", logarithmic=True)
    values = spread(view.record.controller, view.scenario.members)
    t = next(iter(view.record.controller.values()))["t_s"][: len(values)]
    shown = np.where(values > 0.0, values, np.nan)
    panel.lines.append(line("spread", (), LineStyle(ROBOTS[0]), t, shown))
    view.expect(panel, SPREAD)
    return panel


def _speeds(view: View) -> Panel:
    panel = view.panel("v_r_hat", "v̂ᵣ and the leader's vᵣ [m/s]", "m/s")
    profile = Points(*leader_profile(view.scenario, view.end_s))
    panel.lines.append(Line("leader", (), _LEADER, profile))
    return panel


def _torques(view: View) -> Section:
    section = Section(
        "torques",
        "Torques",
        "A panel per robot, at the wheel. Dashed: the tightest limit.",
        columns=2,
    )
    section.keys = [("right, commanded", _RIGHT), ("left, commanded", _LEFT)]
    felt = False
    for robot in view.robots:
        panel = Panel(f"{robot}: τ [N·m]", "N·m", group=group_of(robot))
        used, truth = view.record.controller[robot], view.record.plant[robot]
        sides = (("right", _RIGHT, _RIGHT_FELT), ("left", _LEFT, _LEFT_FELT))
        for side, _, style in sides:
            if len(truth) and _differs(truth, side):
                felt = True
                values = truth[f"motor_{side}_wheel_N_m"]
                panel.lines.append(line(f"{side}, motor", (), style, truth["t_s"], values))
        for side, style, _ in sides:
            if len(used):
                values = used[f"tau_{side}_wheel_N_m"]
                panel.lines.append(line(f"{side}, commanded", (), style, used["t_s"], values))
            for name in (f"tau_{side}_wheel_N_m", f"motor_{side}_wheel_N_m"):
                view.expect(panel, name, robot)
        panel.bounds += _torque_bounds(view, robot)
        section.panels.append(panel)
    if felt:
        section.keys = [
            *section.keys,
            ("right, motor", _RIGHT_FELT),
            ("left, motor", _LEFT_FELT),
        ]
    if not view.few:
        section.panels.insert(0, _all_torques(view))
    return section


def _torque_bounds(view: View, robot: str) -> list[Bound]:
    """The tightest of what limits a wheel's torque at standstill, if anything is known to."""
    own = next(one for one in view.scenario.robot if one.name == robot)
    try:
        limit = tightest(view.scenario, own)
    except ScenarioError:  # a record is shown where the files of its law aren't, too
        limit = None
    if limit is None:
        return []
    level = limit.torque_wheel_N_m
    text = f"limit {level:.3g} N·m: {limit.words} ({limit.key})"
    return [Bound(sign * level, 0.0, view.end_s, "limit", text) for sign in (1.0, -1.0)]


def _differs(truth: np.ndarray, side: str) -> bool:
    """Whether a motor gives another torque than was asked for."""
    felt, asked = truth[f"motor_{side}_wheel_N_m"], truth[f"input_{side}_wheel_N_m"]
    return not np.allclose(felt, asked, rtol=1e-3, atol=1e-3, equal_nan=True)


def _all_torques(view: View) -> Panel:
    panel = Panel("all robots: greatest |τ| [N·m]", "N·m")
    rows = view.record.controller.values()
    sides = [r[f"tau_{side}_wheel_N_m"] for r in rows for side in ("right", "left")]
    t = max((r["t_s"] for r in rows), key=len)
    panel.lines.append(Line("greatest of all", (), LineStyle(ROBOTS[0]), widest(t, sides)))
    return panel


def _buses(view: View) -> Section:
    panel = Panel("load [%]", "%")
    for n, one in enumerate(view.traffic):
        style = robot_style(n)
        drawn = LineStyle(style.colour, style.dash)
        panel.lines.append(line(one.bus, (), drawn, one.t_s, one.load * 100.0))
    timed = "" if view.scenario.bus.timing == "wire" else ", if frames took their time here"
    worst = "; ".join(f"{one.bus}: {one.slowest}" for one in view.traffic)
    note = (
        f"Load of each bus{timed}. Longest response at worst, from due to the end of its frame, as"
        f" part of the message's period: {worst}."
    )
    keys = [(one.bus, line.style) for one, line in zip(view.traffic, panel.lines, strict=True)]
    return Section("buses", "Buses", note, [panel], keys=keys)


def _drives(view: View) -> Section:
    """A panel per robot and quantity: its wheels' lines are noisy."""
    note = "What the drives said of themselves on their buses."
    section = Section("drives", "Drives", note, columns=3)
    section.keys = [("right", _RIGHT), ("left", _LEFT)]
    of_node = {
        (view.scenario.bus_of(robot), node): (robot, side)
        for robot in view.robots
        for node, side in zip(view.scenario.nodes_of(robot), ("right", "left"), strict=True)
    }
    panels: dict[tuple[str, str], Panel] = {}
    for traffic in view.traffic:
        for one in traffic.measured:
            robot, side = of_node.get((traffic.bus, one.node), ("", ""))
            if not robot:
                continue
            title = f"{robot}: {one.name.replace('_', ' ')} [{one.unit}]"
            panel = panels.setdefault(
                (robot, one.name), Panel(title, one.unit, group=group_of(robot))
            )
            style = _RIGHT if side == "right" else _LEFT
            shown = decimated(one.t_s, one.values, _LAW_POINTS)
            panel.lines.append(Line(side, (), style, shown))
    section.panels = [panels[robot, name] for robot, name in sorted(panels)]
    return section


def _ages(view: View) -> Section:
    note = "Age of what each robot used, by its source: a line per edge."
    section = Section("ages", "Age of neighbours' data", note, columns=2)
    for robot in view.robots:
        rows = view.record.controller[robot]
        panel = Panel(f"to {robot}: age [s]", "s", group=group_of(robot))
        for n, (source, ages) in enumerate(ages_of(rows).items()):
            if source in view.robots:
                style = view.style(source)
            else:
                style = LineStyle(ROBOTS[6], robot_style(4 * n).dash)
            shown = decimated(rows["t_s"], ages, view.points(6))
            panel.lines.append(Line(f"{source} → {robot}", (), style, shown))
        if panel.lines:
            section.panels.append(panel)
    return section


def _clock(view: View) -> Section:
    note = "Of every controller on the wall clock: wake-up after the due time, torque to feedback."
    section = Section("clock", "Round trips and lateness", note)
    if view.scenario.clock.mode != "realtime":
        return section
    for name, title in (("late_s", "wake-up late [µs]"), ("round_trip_s", "round trip [µs]")):
        panel = Panel(title, "µs", logarithmic=True)
        for robot in view.robots:
            rows = view.record.controller[robot]
            values = np.where(rows[name] > 0.0, rows[name] * 1e6, np.nan)
            if np.isfinite(values).any():
                shown = decimated(rows["t_s"], values, view.points(len(view.robots)))
                panel.lines.append(Line(robot, (group_of(robot),), view.style(robot), shown))
        section.panels.append(panel)
    return section


def _laws(view: View) -> Section:
    note = "What the robots' laws record of themselves: estimates, filters, surfaces."
    section = Section("laws", "Adaptation and the laws' own signals", note, columns=3)
    units = {
        one.name: one
        for robot in view.robots
        for one in law_table(view.record.signals.get(robot, ()))
    }
    for name, signal in units.items():
        unit = signal.unit
        panel = view.panel(
            name,
            f"{name} [{unit}]" if unit != "1" else name,
            unit,
            points=min(_LAW_POINTS, 4000 // max(1, len(view.robots))),
        )
        section.panels.append(panel)
    return section


_SECTIONS: Sequence[Callable[[View], Section]] = (
    _errors,
    _agreement,
    _torques,
    _drives,
    _laws,
    _buses,
    _ages,
    _clock,
)
