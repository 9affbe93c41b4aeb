"""All faults of one run, the scenario's and the ordered ones: what each is and since when. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from configs.errors import ScenarioError
from configs.faults.absences import Absence, absences
from configs.faults.base import Fault, PlannedFault
from configs.faults.plan import planned_faults, targets_of
from configs.roles import AGENT
from configs.scenario import Scenario


@dataclass(slots=True)
class Entry:
    """One fault of a run."""

    name: str
    fault: Fault
    targets: tuple[str, ...]
    from_tick: int
    to_tick: int | None  # the first tick at which it acts no more; None: it has no end
    ordered: bool = False
    """During the run, rather than in the scenario."""
    cleared: bool = False
    """It was ended before its time."""
    ticks: dict[str, int] = field(default_factory=dict)
    """When it began, by process, where one was late (in real time)."""

    @property
    def never_acted(self) -> bool:
        """Whether it was ended before it began."""
        return self.to_tick is not None and self.to_tick <= self.from_tick

    def state(self, tick: int) -> str:
        """planned, acting or over at a tick; cleared if it was ended before its time."""
        if tick < self.from_tick:
            return "cleared" if self.cleared and self.to_tick == self.from_tick else "planned"
        if self.fault.INSTANT:
            return "over"
        if self.to_tick is None or tick < self.to_tick:
            return "acting"
        return "cleared" if self.cleared else "over"


class FaultLedger:
    """The faults of one run in the order in which they came."""

    def __init__(self, scenario: Scenario) -> None:
        self._period_s = scenario.clock.control_period_s
        self._entries: dict[str, Entry] = {}
        for name, _, fault, first, last in planned_faults(scenario):
            if name not in self._entries:
                targets = tuple(targets_of(fault, scenario))
                self._entries[name] = Entry(name, fault, targets, first, last)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all faults, also of those that are over."""
        return tuple(self._entries)

    def add(self, entry: Entry) -> None:
        """Note a fault that was ordered."""
        self._entries[entry.name] = entry

    def end(self, entry: Entry, tick: int) -> None:
        """Note that a fault ends at a tick, before its time."""
        entry.cleared = True
        entry.to_tick = max(tick, entry.from_tick)

    def to_end(self, names: Sequence[str], tick: int) -> list[Entry]:
        """The faults of these names, or all if none is given, that can be ended at a tick.

        Raises:
            ScenarioError: one can't; the text says why.
        """
        if not names:
            going = (one for one in self._entries.values() if not one.cleared)
            return [one for one in going if one.state(tick) in ("planned", "acting")]
        found = []
        for name in dict.fromkeys(names):
            entry = self._entries.get(name)
            if entry is None:
                known = ", ".join(self._entries) or "none"
                raise ScenarioError(f"{name}: no such fault in this run; there are: {known}")
            state = entry.state(tick)
            if entry.cleared:
                raise ScenarioError(f"{name}: was cleared already")
            if state == "over":
                why = "happened at an instant" if entry.fault.INSTANT else "is over"
                raise ScenarioError(f"{name}: {why}, at tick {entry.to_tick or entry.from_tick}")
            found.append(entry)
        return found

    def differing(self, tick: int) -> list[Entry]:
        """What a process that only knows the scenario doesn't know: ordered, and cleared."""
        entries = self._entries.values()
        going = ("planned", "acting")
        ordered = [one for one in entries if one.ordered and one.state(tick) in going]
        return ordered + [one for one in entries if one.cleared and not one.ordered]

    def planned(self) -> list[PlannedFault]:
        """All faults as they were, or are to be, on each of their targets."""
        return [
            PlannedFault(one.name, target, one.fault, first, one.to_tick)
            for one in self._entries.values()
            if not one.never_acted
            for target in one.targets
            for first in [one.ticks.get(AGENT.process(target), one.from_tick)]
        ]

    def absences(self, ticks: int) -> tuple[Absence, ...]:
        """The absences of controllers by all faults, in a run of so many ticks."""
        return absences(self.planned(), ticks)

    def absent(self, tick: int, ticks: int) -> set[str]:
        """The processes of controllers that are absent by faults at a tick, in a run of `ticks`."""
        return {AGENT.process(it.robot) for it in self.absences(ticks) if it.lasts_at(tick)}

    def rows(self, tick: int) -> list[dict[str, Any]]:
        """All faults as they are at a tick, for people and programs."""
        return [self.row(one, tick) for one in self._entries.values()]

    def row(self, entry: Entry, tick: int) -> dict[str, Any]:
        """One fault as it is at a tick."""
        last = entry.to_tick
        row = {
            "name": entry.name,
            "kind": entry.fault.kind,
            "targets": list(entry.targets),
            "parameters": entry.fault.parameters,
            "ordered": entry.ordered,
            "state": entry.state(tick),
            "from_tick": entry.from_tick,
            "from_s": self._seconds(entry.from_tick),
            "to_tick": last,
            "to_s": None if last is None else self._seconds(last),
        }
        return row | ({"ticks": entry.ticks} if entry.ticks else {})

    def tables(self) -> list[dict[str, Any]]:
        """The entries of [[fault]] that repeat all faults as they were, or are to be."""
        return [table for one in self._entries.values() if (table := self._table(one))]

    def _table(self, entry: Entry) -> dict[str, Any]:
        """The table of [[fault]] that repeats a fault as it was; empty: it never acted."""
        if entry.never_acted:
            return {}
        for_s = None if entry.to_tick is None else self._seconds(entry.to_tick - entry.from_tick)
        fault = replace(
            entry.fault, name=entry.name, at_s=self._seconds(entry.from_tick), for_s=for_s
        )
        values = {one.name: getattr(fault, one.name) for one in fields(fault)}
        return {key: value for key, value in values.items() if value is not None}

    def _seconds(self, tick: int) -> float:
        return round(tick * self._period_s, 9)
