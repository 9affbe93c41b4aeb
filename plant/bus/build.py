"""The buses of a plant in lockstep, as its brief wants them: ideal, or with a wire."""

from collections.abc import Callable, Mapping, Sequence
from random import Random

from bridge.telemetry import Tap, no_tap
from configs.brief import PlantBrief
from plant.bus.ideal import Begin, IdealBus
from plant.bus.timed import WireBus
from plant.robot import Unit

Emulation = IdealBus | WireBus


def emulations(
    brief: PlantBrief,
    units: Sequence[Unit],
    begin: Callable[[Sequence[Unit]], Begin],
    taps: Mapping[str, Tap],
) -> dict[str, Emulation]:
    """All buses by name, with the robots on them in the order of the scenario.

    `begin` makes what is told each tick from the robots of a bus; `taps` hear what crosses it.
    """
    by_bus: dict[str, list[Unit]] = {}
    for unit in units:
        by_bus.setdefault(unit.brief.bus, []).append(unit)
    return {
        bus: _emulation(brief, bus, group, begin(group), taps.get(bus, no_tap))
        for bus, group in by_bus.items()
    }


def wire_bus(brief: PlantBrief, bus: str, units: Sequence[Unit], begin: Begin, tap: Tap) -> WireBus:
    """A bus with the bit timing that the brief wants.

    Raises:
        ValueError: it wants none.
    """
    if brief.wire is None:
        raise ValueError(f"bus {bus} is ideal")
    step_ns = brief.schedule.period_ns // brief.substeps
    random = Random(f"{brief.seed}/{bus}/firmware")
    return WireBus(units, brief.schedule, brief.wire, step_ns, begin, tap, random)


def _emulation(
    brief: PlantBrief, bus: str, units: Sequence[Unit], begin: Begin, tap: Tap
) -> Emulation:
    if brief.wire is None:
        return IdealBus(units, brief.schedule, brief.substeps, begin, tap)
    return wire_bus(brief, bus, units, begin, tap)
