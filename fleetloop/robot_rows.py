"""Status rows of robots on a terminal: as much as its width and height have room for.

    robot  phase    |x_e| m  |y_e| m  τ N·m    bus  heard  drives
    r1     driving    0.012    0.003  +0.31   34 %  10 ms  closed loop control
    r2     stopped    0.532    0.040  +0.00   34 %  10 ms  idle: ESTOP_REQUESTED

τ is the wheel's with the greater torque; `bus` the load of the robot's bus, or frames per second of
bus time where it has no bit timing; `heard` the age of the oldest path state of its neighbours.
Robots come in the order of the scenario. Where there is no room for all, those are shown that need
to be looked at: first those that don't drive, then those that are farthest from their references.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from math import hypot
from typing import NamedTuple

from bridge.network.status import Value
from fleetloop.robot_states import RobotState

LEAST_WIDTH = 24
"""Of a terminal that has rows at all."""
_GAP = 2
_CALM = {"driving": "", "left": "dim", "done": "dim", "": "dim"}
_BUSY = {"arming": "yellow", "ready": "yellow", "rearming": "yellow"}
_TROUBLE = "bold red"


class Line(NamedTuple):
    """One line, and its style."""

    text: str
    style: str = ""


class _Column(NamedTuple):
    title: str
    text: Callable[[RobotState], str]
    width: int  # at least
    importance: int  # the least important ones go first where there is no room
    right: bool = True


def rows(
    states: Sequence[RobotState],
    width: int,
    height: int,
    spelled: Callable[[str], str] = lambda text: text,
) -> list[Line]:
    """The header and a line per robot, at most `height` lines of at most `width` characters.

    `spelled`: text as the terminal can show it.
    """
    if width < LEAST_WIDTH or height < 2 or not states:
        return []
    fits = len(states) < height
    shown = list(states) if fits else _worst_of(states, max(height - 2, 0))
    columns = _columns(shown, width, spelled)
    lines = [Line(_joined(columns, [spelled(it.title) for it in columns], width), "dim")]
    for state in shown:
        texts = [spelled(column.text(state)) for column in columns]
        lines.append(Line(_joined(columns, texts, width), style_of(state.phase)))
    if not fits:
        hidden = [state for state in states if state not in shown]
        lines.append(Line(_cut(spelled(_summary(hidden)), width), "dim"))
    return lines


def style_of(phase: str) -> str:
    """Of a line: what drives is plain, what doesn't is seen."""
    return _CALM.get(phase, _BUSY.get(phase, _TROUBLE))


def _worst_of(states: Sequence[RobotState], count: int) -> list[RobotState]:
    """Those to be looked at, in the order of the scenario, so that lines change seldom."""
    ranked = sorted(range(len(states)), key=lambda at: (_rank(states[at]), -_far(states[at])))
    return [states[at] for at in sorted(ranked[:count])]


def _rank(state: RobotState) -> int:
    if style_of(state.phase) == _TROUBLE:
        return 0
    return 1 if state.phase in _BUSY else 2


def _far(state: RobotState) -> float:
    """Distance from the reference [m]; 0 where it isn't known."""
    return hypot(state.x_e_m or 0.0, state.y_e_m or 0.0)


def _summary(hidden: Sequence[RobotState]) -> str:
    counts = Counter(state.phase for state in hidden if state.phase)
    phases = ", ".join(f"{n} {phase}" for phase, n in counts.most_common())
    far = f", at most {_metres(max(map(_far, hidden)))} m off" if counts else ""
    return f"+ {len(hidden)} more{f': {phases}{far}' if phases else ''}"


# --- columns --------------------------------------------------------------------------------------


def _metres(value: Value) -> str:
    return "-" if value is None else _short(abs(value), 3)


def _short(value: float, decimals: int, sign: str = "") -> str:
    """A number in seven characters."""
    if abs(value) >= 1000.0:
        return f"{value:{sign}.1e}"
    return f"{value:{sign}.{decimals if abs(value) < 100.0 else 1}f}"


def _torque(state: RobotState) -> str:
    torques = [it for it in (state.right_wheel_N_m, state.left_wheel_N_m) if it is not None]
    return _short(max(torques, key=abs), 2, "+") if torques else "-"


def _bus(state: RobotState) -> str:
    if state.bus_load is not None:
        return f"{state.bus_load:.0%}".replace("%", " %")
    rate = state.bus_frames_per_s
    if rate is None:
        return "-"
    return f"{rate / 1000:.1f}k/s" if rate >= 1000 else f"{rate:.0f}/s"


def _heard(state: RobotState) -> str:
    if state.neighbour_age_s is None:
        return "-" if not state.neighbours else "never"
    age_s = state.neighbour_age_s
    return f"{age_s * 1e3:.0f} ms" if age_s < 1.0 else f"{age_s:.1f} s"


def _drives(state: RobotState) -> str:
    right, left = map(_drive, (state.right_drive, state.left_drive))
    if right == left:
        return right or "-"
    return f"right {right}, left {left}"


def _drive(words: str) -> str:
    """A state is told in small letters; errors as the drive's manual has them."""
    state, colon, errors = words.partition(":")
    return f"{state.replace('_', ' ').lower()}{colon}{errors}"


_ROBOT = _Column("robot", lambda state: state.robot, 5, 0, right=False)
_DRIVES = _Column("drives", _drives, 12, 7, right=False)
_COLUMNS = (
    _ROBOT,
    _Column("phase", lambda state: state.phase or "starting", 8, 1, right=False),
    _Column("|x_e| m", lambda state: _metres(state.x_e_m), 7, 2),
    _Column("|y_e| m", lambda state: _metres(state.y_e_m), 7, 6),
    _Column("τ N·m", _torque, 7, 3),
    _Column("bus", _bus, 6, 4),
    _Column("heard", _heard, 6, 5),
    _DRIVES,
)
_LONGEST_NAME = 16


def _columns(
    shown: Sequence[RobotState], width: int, spelled: Callable[[str], str]
) -> list[_Column]:
    """The columns that there is room for, as wide as what is in them."""
    wide = [
        column._replace(width=_width(column, shown, spelled)) if column is not _DRIVES else column
        for column in _COLUMNS
    ]
    while sum(it.width for it in wide) + _GAP * (len(wide) - 1) > width and len(wide) > 1:
        wide.remove(max(wide, key=lambda column: column.importance))
    return wide


def _width(column: _Column, shown: Sequence[RobotState], spelled: Callable[[str], str]) -> int:
    texts = [column.title, *map(column.text, shown)]
    longest = max(len(spelled(text)) for text in texts)
    if column is _ROBOT:
        return min(max(column.width, longest), _LONGEST_NAME)
    return max(column.width, longest)


def _joined(columns: Sequence[_Column], texts: Sequence[str], width: int) -> str:
    parts = []
    for column, text in zip(columns, texts, strict=True):
        cut = text if column is columns[-1] else _cut(text, column.width)
        parts.append(cut.rjust(column.width) if column.right else cut.ljust(column.width))
    return _cut((" " * _GAP).join(parts).rstrip(), width)


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: max(width - 1, 0)] + "~"
