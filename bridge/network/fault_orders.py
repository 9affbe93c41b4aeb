"""Orders of faults during a run.

The launcher has validated an order by the scenario; the plant and the controllers carry it out at a
tick, and answer with that tick or with a reason why not.

    FaultOrder   [1, number, ends, name, targets, fault, from_tick, ticks, exact] @order/<process>

`fault` is the table of [[fault]] without the keys that the other fields give. In real time the
launcher orders of each process what concerns it. In lockstep it orders of the plant, which owns
time: the plant hands on what concerns controllers, ahead of a pose that each of them waits for, so
that all of them have it before the tick at which it is due.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple, get_type_hints

from bridge.fault_schedule import FaultSchedule
from bridge.network.packing import ints, pack, unpack
from bridge.network.run_orders import order_tick
from configs.conformity import conforms
from configs.edges import hearer
from configs.faults.base import Fault, PlannedFault
from configs.faults.kinds import KINDS
from configs.parameters import as_tuples

MOST_TARGETS = 1 << 12
MOST_TEXT = 500
"""Characters of a name, a target or a refusal."""
_GIVEN = frozenset(("name", "at_s", "for_s", "robots"))
"""Keys of a fault that other fields of an order give."""


class FaultOrder(NamedTuple):
    """A fault to apply, or to end before its time."""

    number: int  # of the order, for the answer
    ends: bool  # the fault of this name, rather than applies it
    name: str  # of the fault
    targets: tuple[str, ...]
    fault: Fault
    from_tick: int
    ticks: int | None  # how long it lasts; None: to the end
    exact: bool
    """Refuse it if that tick has gone; otherwise it acts as soon as it can, not before."""

    def encode(self) -> bytes:
        """Bytes for the wire."""
        number, ends, name, targets, fault, *rest = self
        return pack(number, ends, name, targets, _table(fault), *rest)

    @classmethod
    def decode(cls, payload: bytes) -> "FaultOrder | None":
        """The message in the bytes, None if there is none."""
        read = unpack(payload, 9)
        if read is None:
            return None
        number, ends, name, targets, table, from_tick, ticks, exact = read[1:]
        lasts = [] if ticks is None else [ticks]
        if not ints([number, from_tick, *lasts]) or type(ends) is not bool:
            return None
        if type(exact) is not bool or type(targets) is not list or len(targets) > MOST_TARGETS:
            return None
        if not all(map(_is_text, (name, *targets))) or (fault := _fault(table)) is None:
            return None
        return cls(number, ends, name, tuple(targets), fault, from_tick, ticks, exact)

    def planned(self, target: str, tick: int, period_s: float) -> PlannedFault:
        """The fault as it acts on one target from a tick on."""
        until = None if self.ticks is None else tick + self.ticks
        fault = replace(self.fault, at_s=tick * period_s)
        return PlannedFault(self.name, target, fault, tick, until)

    def act(self, schedules: Mapping[str, FaultSchedule], tick: int, period_s: float) -> int | str:
        """Plan the fault on each of its targets, or its end, from a tick on.

        Returns the tick, or why it can't act; `schedules` by target.
        """
        if strangers := [target for target in self.targets if target not in schedules]:
            return f"{strangers[0]}: nothing here that it can act on"
        for target in self.targets:
            if self.ends:
                schedules[target].clear(self.name, tick)
            elif not schedules[target].knows(self.name, target):  # else it is told again
                schedules[target].add(self.planned(target, tick, period_s))
        return tick

    def tick(self, earliest: int, ticks: int) -> int | str:
        """The tick at which it acts in a run of so many, or why it can't."""
        return order_tick(self.from_tick, earliest, ticks, exact=self.exact)


def _table(fault: Fault) -> dict[str, Any]:
    given = {key: value for key, value in fault.parameters.items() if value is not None}
    return {"kind": fault.kind} | given


def _fault(table: object) -> Fault | None:
    """The fault in a table as `_table` makes it, None if there is none."""
    if type(table) is not dict or not all(type(key) is str for key in table):
        return None
    kind = table.get("kind")
    made = KINDS.get(kind) if type(kind) is str else None
    if made is None or _GIVEN & table.keys():
        return None
    values: dict[str, Any] = as_tuples(table)
    hints = get_type_hints(made, include_extras=True)
    known = {one.name for one in fields(made)}
    if not all(key in known and conforms(value, hints[key]) for key, value in values.items()):
        return None
    return made(**values, at_s=0.0)


def _is_text(value: object) -> bool:
    return type(value) is str and len(value) <= MOST_TEXT


def targets_to(targets: Sequence[str], robot: str) -> tuple[str, ...]:
    """Those targets that concern a controller: its robot, and edges to it."""
    return tuple(target for target in targets if hearer(target) == robot)
