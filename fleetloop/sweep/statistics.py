"""Statistics of a signal over a run: what a column of a dataset holds.

    peak_SIGNAL           greatest magnitude
    final_SIGNAL          greatest magnitude in the last `FINAL_S`
    rms_SIGNAL            root mean square over ticks and robots
    mean_SIGNAL           mean over ticks and robots
    least_SIGNAL          least value
    greatest_SIGNAL       greatest value
    settle_s_of_SIGNAL    time from which on it stays within ±`SETTLE_BAND` [s]; none: it ends
                          outside
    growth_1_s_of_SIGNAL  growth of its fastest mode, over all robots together [1/s]; above 0 it is
                          unstable (`fleetloop.sweep.growth`); none: it is no linear motion

Of several robots, or pairs, the worst one; a robot counts while it is a member. A signal is a
recorded or derived one (`configs.signals`), or `torque_wheel_N_m`: the commands to both wheels.
What isn't finite, or isn't known, is no value.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np
from annotated_types import Len

from configs.parameters import Parameters, parameter
from fleetloop.settling import FINAL_S, settle_s
from fleetloop.sweep.draws import Column
from fleetloop.sweep.growth import growth_1_s

Kind = Literal["peak", "final", "rms", "mean", "least", "greatest", "settle_s_of", "growth_1_s_of"]
UNITS: Mapping[Kind, str] = {"settle_s_of": "s", "growth_1_s_of": "1/s"}
"""Of statistics that haven't the signal's."""
TORQUE = "torque_wheel_N_m"
TORQUES = ("tau_right_wheel_N_m", "tau_left_wheel_N_m")


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantitySection(Parameters):
    """A column with a name, or robots, of its own."""

    name: Column = field(metadata={"description": "of the column"})
    statistic: Kind = field(metadata={"description": "of the signal over the run"})
    signal: Annotated[str, Len(1, 100)] = field(metadata={"description": "recorded or derived"})
    robots: Annotated[tuple[str, ...], Len(1)] | None = parameter(None, "all if not given")


class Course(NamedTuple):
    """A signal of one robot, or between some: its known values and their times."""

    t_s: np.ndarray
    values: np.ndarray


def parts_of(text: str) -> tuple[Kind, str] | None:
    """The statistic and the signal of a column's name; None if it names no statistic."""
    for kind in get_args(Kind):
        if text.startswith(f"{kind}_") and len(text) > len(kind) + 1:
            return kind, text[len(kind) + 1 :]
    return None


def statistic(kind: Kind, courses: Sequence[Course]) -> float | None:
    """The statistic of these courses together; None if there is none."""
    there = [course for course in courses if len(course.values)]
    if not there:
        return None
    with np.errstate(all="ignore"):
        value = _STATISTICS[kind](there)
    return value if value is not None and np.isfinite(value) else None


def _magnitude(courses: Sequence[Course]) -> float:
    return max(float(np.abs(course.values).max()) for course in courses)


def _final(courses: Sequence[Course]) -> float:
    return _magnitude([Course(t, v[t > t[-1] - FINAL_S]) for t, v in courses])


def _all(courses: Sequence[Course]) -> np.ndarray:
    return np.concatenate([course.values for course in courses])


def _settle_s(courses: Sequence[Course]) -> float | None:
    times = [settle_s(*course) for course in courses]
    known = [t for t in times if t is not None]
    return max(known) if len(known) == len(times) else None


def _growth_1_s(courses: Sequence[Course]) -> float | None:
    first = courses[0].t_s
    if any(not np.array_equal(course.t_s, first) for course in courses[1:]):
        return None  # robots that joined late, or left
    return growth_1_s(first, [course.values for course in courses])


_STATISTICS: Mapping[Kind, Callable[[Sequence[Course]], float | None]] = {
    "peak": _magnitude,
    "final": _final,
    "rms": lambda courses: float(np.sqrt(np.mean(_all(courses) ** 2))),
    "mean": lambda courses: float(np.mean(_all(courses))),
    "least": lambda courses: float(np.min(_all(courses))),
    "greatest": lambda courses: float(np.max(_all(courses))),
    "settle_s_of": _settle_s,
    "growth_1_s_of": _growth_1_s,
}
