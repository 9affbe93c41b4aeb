"""Every signal that a run records of every robot at every tick, and those that are made of them.

The plant gives the truth about a robot; its controller gives what it used, what its law says of the
tick (a table that the law brings) and what it commanded. A record carries the names and units of
its rows, so everything that reads one goes by name.
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple


class Signal(NamedTuple):
    """One recorded signal."""

    name: str
    unit: str
    meaning: str


PLANT_SIGNALS: tuple[Signal, ...] = (
    Signal("t_s", "s", "scenario time of the tick"),
    Signal("x_m", "m", "true position, world"),
    Signal("y_m", "m", "true position, world"),
    Signal("theta_rad", "rad", "true heading, not wrapped"),
    Signal("v_m_s", "m/s", "true forward speed"),
    Signal("omega_rad_s", "rad/s", "true turn rate"),
    Signal(
        "input_right_wheel_N_m",
        "N·m",
        "torque at the wheel that the right drive was last told, before limits",
    ),
    Signal(
        "input_left_wheel_N_m",
        "N·m",
        "torque at the wheel that the left drive was last told, before limits",
    ),
    Signal(
        "demand_right_wheel_N_m",
        "N·m",
        "torque at the wheel, asked of the right motor at last, after limits",
    ),
    Signal(
        "demand_left_wheel_N_m",
        "N·m",
        "torque at the wheel, asked of the left motor at last, after limits",
    ),
    Signal("motor_right_wheel_N_m", "N·m", "torque that the right wheel felt at last"),
    Signal("motor_left_wheel_N_m", "N·m", "torque that the left wheel felt at last"),
)
"""Truth of one robot at one tick, before the controller answers."""

PATH_ERRORS: tuple[Signal, ...] = (
    Signal("x_e_m", "m", "path following error, (8)"),
    Signal("y_e_m", "m", "path following error, (8)"),
    Signal("theta_e_rad", "rad", "path following error, (8), in (−π, π]"),
)
"""Where the robot is, seen from itself, against its reference."""

USED_SIGNALS: tuple[Signal, ...] = (
    Signal("t_s", "s", "scenario time of the tick"),
    Signal("x_used_m", "m", "position that the controller used"),
    Signal("y_used_m", "m", "position that the controller used"),
    Signal("theta_used_rad", "rad", "heading that the controller used"),
    Signal("v_used_m_s", "m/s", "forward speed that the controller used"),
    Signal("omega_used_rad_s", "rad/s", "turn rate that the controller used"),
    Signal("s", "m", "path variable"),
    Signal("s_dot", "m/s", "its rate, mu + v_r_hat"),
    Signal("mu", "m/s", "coordination state of (40)"),
    Signal("v_r_hat", "m/s", "estimate of the reference speed, (38)"),
    Signal("neighbours", "1", "in-neighbours that counted in the sums"),
    Signal("x_d_m", "m", "reference position, (1)"),
    Signal("y_d_m", "m", "reference position, (1)"),
    Signal("theta_d_rad", "rad", "reference heading, (8)"),
)
"""What a controller used at one tick."""

SENT_SIGNALS: tuple[Signal, ...] = (
    Signal(
        "tau_right_wheel_N_m",
        "N·m",
        "torque commanded at the wheel, as float32 on the bus carries it",
    ),
    Signal(
        "tau_left_wheel_N_m",
        "N·m",
        "torque commanded at the wheel, as float32 on the bus carries it",
    ),
    Signal("late_s", "s", "in real time, wall time from the tick's due time to its computation"),
    Signal("round_trip_s", "s", "in real time, from the last torques sent to their feedback"),
)
"""What a controller commanded at one tick, and how well it kept its time."""

AGE_PREFIX = "age_of_"


def age_signals(sources: Sequence[str]) -> tuple[Signal, ...]:
    """Ages of what a robot uses, by its sources."""
    return tuple(
        Signal(f"{AGE_PREFIX}{source}_s", "s", f"age of what was sent last of all from {source}")
        for source in sources
    )


SPREAD, DISTANCE, PATH_DISTANCE = "s_spread", "robot_distance_m", "path_distance_m"

DERIVED_SIGNALS: tuple[Signal, ...] = (
    Signal(SPREAD, "m", "max_i s_i − min_i s_i over the robots that are members"),
    Signal(DISTANCE, "m", "between the wheel axles' centres of two robots, of every pair"),
    Signal(
        PATH_DISTANCE, "m", "from the nearest point of the robot's own path, its offset included"
    ),
)
"""What expectations may be about besides recorded signals: made of the record."""

_NAME = re.compile(r"[A-Za-z](?:_?[A-Za-z0-9])*")
_PATH_ERROR_NAMES = frozenset(signal.name for signal in PATH_ERRORS)
_TAKEN = frozenset(
    name.lower()
    for name in (
        *("tick", "robot"),
        *(signal.name for signal in DERIVED_SIGNALS),
        *(signal.name for signal in (*PLANT_SIGNALS, *USED_SIGNALS, *SENT_SIGNALS)),
    )
)


def gives_path_errors(law: Sequence[Signal]) -> bool:
    """Whether a law's table has `PATH_ERRORS` in it; else the controller adds them."""
    return any(signal.name in _PATH_ERROR_NAMES for signal in law)


def controller_signals(law: Sequence[Signal], aged: Sequence[str] = ()) -> tuple[Signal, ...]:
    """The row of a controller: what it used, its law's signals, what it sent.

    Args:
        law: the table of the law.
        aged: sources whose ages are recorded, in the order of the record.
    """
    own = law if gives_path_errors(law) else (*PATH_ERRORS, *law)
    return (*USED_SIGNALS, *age_signals(aged), *own, *SENT_SIGNALS)


def law_table(controller: Sequence[Signal]) -> tuple[Signal, ...]:
    """The signals of the law alone in the row of a controller, without the errors (8)."""
    return tuple(
        signal
        for signal in controller[len(USED_SIGNALS) : -len(SENT_SIGNALS)]
        if signal.name not in _PATH_ERROR_NAMES and not signal.name.startswith(AGE_PREFIX)
    )


def signals_fault(law: object) -> str | None:
    """Why a law's table can't be recorded, None if it can."""
    try:
        return _signals_fault(law)
    except TypeError:  # a list, or what else has no hash
        return _signals_fault.__wrapped__(law)


@lru_cache(maxsize=64)
def _signals_fault(law: object) -> str | None:
    if not isinstance(law, tuple):
        return "SIGNALS must be a tuple of Signal(name, unit, meaning)"
    seen: set[str] = set()
    for signal in law:
        texts = isinstance(signal, tuple) and all(isinstance(text, str) for text in signal)
        if not texts or len(signal) != len(Signal._fields):
            return f"SIGNALS: {signal!r} is no Signal(name, unit, meaning)"
        name, *about = signal
        if not _NAME.fullmatch(name):
            return f"SIGNALS: {name!r}: a name has letters, digits and single underscores"
        if name.lower() in _TAKEN or name.lower().startswith(AGE_PREFIX):
            return f"SIGNALS: {name} is recorded of every robot already; choose another name"
        if name.lower() in seen:
            return f"SIGNALS: {name} comes twice (upper and lower case are one in a record)"
        if any(not text.isprintable() for text in about):
            return f"SIGNALS: {name}: unit and meaning must be one line"
        seen.add(name.lower())
    if 0 < len(_PATH_ERROR_NAMES & {name for name, *_ in law}) < len(PATH_ERRORS):
        return f"SIGNALS: give all of {', '.join(sorted(_PATH_ERROR_NAMES))}, or none of them"
    return None
