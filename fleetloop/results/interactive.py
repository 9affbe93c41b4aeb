"""The interactive part of a page: Bokeh's scripts, plots in their places, and the controls.

Nothing is fetched: Bokeh's scripts stand in the page. Names go through `escape`, or as data of the
plots through Bokeh's embedding, which escapes them, too.
"""

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from fleetloop.results.pages import resource
from fleetloop.results.panel import LineStyle, Section
from fleetloop.results.sections import sections
from fleetloop.results.view import View, group_of
from fleetloop.settling import FINAL_S

_GRIDS = {1: "", 2: "two", 3: "three"}


class Interactive(NamedTuple):
    """Parts of a page."""

    head: str
    body: str
    scripts: str


def plots_of(view: View) -> Interactive:
    """The plots of a run."""
    from bokeh.document import Document
    from bokeh.embed import components
    from bokeh.model import Model
    from bokeh.resources import Resources

    from fleetloop.results.palette import plot_theme
    from fleetloop.results.plane_plot import plane
    from fleetloop.results.plots import HEIGHT, SMALL, TimePlots

    found = sections(view)
    time_plots = TimePlots(view.end_s, view.marks)
    models: dict[str, Model] = {}
    if (drawn := plane(view)) is not None:
        models["plane"] = drawn
    if (drawn := time_plots.timeline()) is not None:
        models["timeline"] = drawn
    for section in found:
        height = HEIGHT if section.columns == 1 else SMALL
        for n, panel in enumerate(section.panels):
            models[f"{section.key}-{n}"] = time_plots.draw(
                panel, height=height, brief=section.columns > 2
            )
    document = Document(theme=plot_theme())
    with document.models.freeze():  # else all models are collected again for every plot
        for model in models.values():
            document.add_root(model)
    script, divs = components(models, wrap_script=False)
    body = [_player(view) + _place(divs["plane"])] if "plane" in divs else []
    body.append(_bar(view))
    if "timeline" in divs:
        body.append(_place(divs["timeline"]))
    body += [_section(section, divs) for section in found]
    scripts = f"<script>{script}</script>\n<script>{resource('report.js')}</script>"
    head = Resources(mode="inline", components=["bokeh"]).render_js()
    return Interactive(head, "\n".join(body), scripts)


def _place(div: str, group: str = "") -> str:
    attribute = f' data-group="{escape(group)}"' if group else ""
    return f'<div class="plot"{attribute}>{div}</div>'


def _section(section: Section, divs: dict[str, str]) -> str:
    panels = "".join(
        _place(divs[f"{section.key}-{n}"], panel.group) for n, panel in enumerate(section.panels)
    )
    keys = "".join(f'<span class="key">{_stroke(s)}{escape(n)}</span>' for n, s in section.keys)
    return (
        f'<section id="{section.key}"><h2>{escape(section.title)}</h2>'
        f'<p class="note">{escape(section.note)}</p>{keys}'
        f'<div class="grid {_GRIDS[section.columns]}">{panels}</div></section>'
    )


def _bar(view: View) -> str:
    """What is shown, and when: one legend of all panels."""
    chips = [
        _chip(group_of(robot), robot, view.style(robot), "shift: this one alone")
        for robot in view.robots
    ]
    if not view.few:
        chips.append(_chip("band", f"all {len(view.record.robots)}", None, "grey: all robots"))
    chips.append(_chip("bounds", "bounds", None, "what was expected"))
    if view.marks.faults or view.marks.events:
        chips.append(_chip("marks", "events", None, "faults, stops and other events"))
    windows = "".join(
        f'<button type="button" data-window="{a:g} {b:g}">{escape(name)}</button>'
        for name, a, b in windows_of(view)
    )
    return (
        f'<div class="bar"><div class="chips">{"".join(chips)}'
        f'<span class="windows">{windows}</span></div></div>'
        '<p class="note"><span class="with-mouse">Drag over a plot: that time, in all of them.'
        "</span> A tap: that instant in the plane. A robot's button hides it, with shift all"
        " others.</p>"
    )


def windows_of(view: View) -> Sequence[tuple[str, float, float]]:
    """Names and spans [s] of windows of time that are looked at again and again."""
    end_s = view.end_s
    begin_s = min([0.0, *(one.t_s for one in view.marks.events)])
    pad_s = 0.01 * (end_s - begin_s)
    found = [("whole run", begin_s - pad_s, end_s + pad_s)]
    settles = [
        settled
        for robot in view.summary["robots"].values()
        for settled in robot["settle_s"].values()
    ]
    if end_s > 4.0:
        found.append(("first 2 s", 0.0, 2.0))
    if settles and None not in settles and 0.0 < max(settles) < 0.9 * end_s:
        found.append(("settled", max(settles), end_s))
    if end_s > 2.0 * FINAL_S:
        found.append((f"last {FINAL_S:g} s", end_s - FINAL_S, end_s))
    return found


def _chip(group: str, name: str, style: LineStyle | None, title: str) -> str:
    stroke = "" if style is None else _stroke(style)
    return (
        f'<button type="button" class="chip" aria-pressed="true" title="{escape(title)}"'
        f' data-toggle="{escape(group)}">{stroke}{escape(name)}</button>'
    )


def _stroke(style: LineStyle) -> str:
    dash = " ".join(map(str, style.dash))
    return (
        f'<svg viewBox="0 0 27 10" aria-hidden="true"><line x1="1" y1="5" x2="26" y2="5"'
        f' stroke="{style.colour}" stroke-width="3" stroke-dasharray="{dash}"/></svg>'
    )


def _player(view: View) -> str:
    step_s = view.end_s / 1000.0
    speeds = "".join(
        f'<option value="{x}"{" selected" if x == 1 else ""}>{x} ×</option>'
        for x in (0.25, 1, 2, 4, 10)
    )
    return (
        '<h2>The plane</h2><div class="player"><button id="play" type="button" aria-label="play">▶'
        f'</button><input id="seek" type="range" min="0" max="{view.end_s:.6g}" step="{step_s:.4g}"'
        ' value="0" aria-label="time"><span id="now">0.00 s</span>'
        f'<select id="speed" aria-label="speed">{speeds}</select></div>'
    )
