"""Section [[expect]]: what has to hold in a run, as a sentence, and the window in which it has to.

signal      of robots, or between them, is within bounds      min, max, max_abs
event       is counted                                        at_least, at_most

within bounds at every tick of the window                     (nothing more)
... at a share of its ticks                                   quantile
... from a time after its beginning on                        settle_within_s
... at some tick, or for so long in one piece                 holds = "eventually", for_s
... at no tick, or never for so long in one piece             holds = "never", for_s

window      of scenario time                                  from_s, to_s
relative to a fault                               after, after_end, during, before
"""

from dataclasses import dataclass, fields
from functools import lru_cache
from math import ceil, floor
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt, Le, Len, Lt

from configs.faults.plan import fault_window
from configs.parameters import (
    Finite,
    Name,
    NotNegative,
    Parameters,
    Seconds,
    SecondsOrZero,
    parameter,
)

if TYPE_CHECKING:
    from configs.scenario import Scenario

_EPSILON = 1e-6
"""Of a tick: times are sums of decimal fractions."""
BOUNDS = ("max_abs", "min", "max")
COUNTS = ("at_least", "at_most")
REFERENCES = ("before", "during", "after", "after_end")
Count = Annotated[int, Ge(0), Le(10_000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Expect(Parameters):
    """What has to hold in a window, or the run ends with exit status 1."""

    name: Annotated[str, Len(1, 100)] | None = parameter(
        None, "of this expectation in results; what it says if not given"
    )
    signal: str | None = parameter(
        None, "a recorded signal, or a derived one: s_spread, robot_distance_m, path_distance_m"
    )
    event: str | None = parameter(None, "instead of a signal: a kind of event, to be counted")
    robots: Annotated[tuple[str, ...], Len(1)] | None = parameter(
        None, "each of them; each robot if not given, of an event all sources together"
    )
    max_abs: NotNegative | None = None
    min: Finite | None = None
    max: Finite | None = None
    holds: Literal["always", "never", "eventually"] = parameter(
        "always", "within the bounds: at all ticks of the window, at none, at one at least"
    )
    for_s: Seconds | None = parameter(
        None, "of never and eventually: in one piece for so long or longer"
    )
    quantile: Annotated[float, Gt(0), Lt(1)] | None = parameter(
        None, "of always: within the bounds at this share of the ticks or more"
    )
    settle_within_s: Seconds | None = parameter(
        None, "of always: from this time after the beginning of the window on, or earlier"
    )
    at_least: Count | None = parameter(None, "events of the window")
    at_most: Count | None = parameter(None, "events of the window; 0: never")
    from_s: SecondsOrZero = parameter(
        0.0, "from the start on; with during, after or after_end from that instant on"
    )
    to_s: Seconds | None = parameter(None, "likewise; the end if not given")
    before: Name | None = parameter(None, "a fault by its name: the window ends before it acts")
    during: Name | None = parameter(None, "a fault: while it acts")
    after: Name | None = parameter(None, "a fault: from its beginning on")
    after_end: Name | None = parameter(None, "a fault: from its end on")

    @property
    def reference(self) -> tuple[str, str] | None:
        """The relation to a fault and the fault's name; None: the window is of scenario time."""
        for key in REFERENCES:
            if (fault := getattr(self, key)) is not None:
                return key, fault
        return None

    @property
    def stated(self) -> dict[str, object]:
        """The keys that differ from their defaults, and `from_s`."""
        values = zip(_KEYS, _VALUES(self), strict=True)
        kept = [(k, v) for k, v in values if v is not None and (k, v) != ("holds", "always")]
        return {k: list(v) if isinstance(v, tuple) else v for k, v in kept}


_KEYS = tuple(key.name for key in fields(Expect))
_VALUES = attrgetter(*_KEYS)


class Window(NamedTuple):
    """The ticks of a window, both ends included; empty if the last is before the first."""

    first: int
    last: int

    def __len__(self) -> int:
        return max(0, self.last - self.first + 1)


def window_of(expect: Expect, scenario: "Scenario", end_s: float) -> Window | None:
    """The window of an expectation; None if its fault, or the end of it, isn't there.

    Args:
        expect: with one reference at most.
        scenario: of the faults; a window may go on beyond `end_s`.
        end_s: end of a window that isn't given one.
    """
    period_s = scenario.clock.control_period_s
    whole_s = max(scenario.duration_s, scenario.ends_at_s)
    begin_s, until_s = 0.0, end_s  # its first tick is at or after it, its last before it
    if expect.reference is not None:
        key, name = expect.reference
        acts = fault_window(scenario, name)
        if acts is None or (key == "after_end" and acts[1] is None):
            return None
        fault_s, fault_end_s = acts
        begin_s = {"before": 0.0, "after_end": fault_end_s or 0.0}.get(key, fault_s)
        if key == "before":
            until_s = fault_s
        elif key == "during" and fault_end_s is not None:
            until_s = min(fault_end_s, whole_s)
    first = ceil((begin_s + expect.from_s) / period_s - _EPSILON)
    last = ceil(until_s / period_s - _EPSILON) - 1
    if expect.to_s is not None:
        to = floor((begin_s + expect.to_s) / period_s + _EPSILON)
        most = last if expect.during else ceil(whole_s / period_s - _EPSILON) - 1
        last = min(to, most)
    return Window(first, last)


@lru_cache(maxsize=256)
def claim(expect: Expect) -> str:
    """An expectation as a sentence."""
    robots = f" of {', '.join(expect.robots)}" if expect.robots else ""
    if expect.event is not None:
        subject = f"event {expect.event}{robots}"
    else:
        subject = f"{expect.signal}{robots}"
    return f"{subject} {_predicate(expect)}{_when(expect)}"


def _predicate(expect: Expect) -> str:
    if expect.event is not None:
        return _count(expect)
    bounds = f"within {_bounds(expect)}"
    piece = f" for {expect.for_s:g} s" if expect.for_s is not None else ""
    match expect.holds:
        case "never":
            return f"never {bounds}{piece}"
        case "eventually":
            return f"eventually {bounds}{piece}"
    if expect.quantile is not None:
        return f"{bounds} at {100.0 * expect.quantile:g} % of the ticks"
    if expect.settle_within_s is not None:
        return f"settles {bounds} in {expect.settle_within_s:g} s"
    return bounds


def _bounds(expect: Expect) -> str:
    parts = []
    if expect.max_abs is not None:
        parts.append(f"±{expect.max_abs:g}")
    if expect.min is not None and expect.max is not None:
        parts.append(f"{expect.min:g} to {expect.max:g}")
    elif expect.min is not None:
        parts.append(f"{expect.min:g} or more")
    elif expect.max is not None:
        parts.append(f"{expect.max:g} or less")
    return " and ".join(parts)


def _count(expect: Expect) -> str:
    least, most = expect.at_least, expect.at_most
    if most == 0:
        return "never"
    if least is not None and most is not None and least != most:
        return f"{least} to {most} times"
    how = "" if least == most else ("at most " if least is None else "at least ")
    times = most if least is None else least
    return how + ("once" if times == 1 else f"{times} times")


def _when(expect: Expect) -> str:
    span = f" from {expect.from_s:g} s" if expect.from_s or expect.reference is None else ""
    span += f" to {expect.to_s:g} s" if expect.to_s is not None else ""
    if expect.reference is None:
        return span
    key, name = expect.reference
    after = {"after_end": "after the end of"}.get(key, key)
    return f"{span} {after} {name}"
