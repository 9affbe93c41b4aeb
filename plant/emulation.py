"""The buses of a plant in lockstep, as its brief wants them: ideal, or with a wire."""

from collections.abc import Callable, Sequence
from random import Random

from configs.brief import PlantBrief
from plant.buses import Begin, IdealBus
from plant.unit import Unit
from plant.wire_bus import WireBus

Emulation = IdealBus | WireBus


def emulations(
    brief: PlantBrief, units: Sequence[Unit], begin: Callable[[Sequence[Unit]], Begin]
) -> dict[str, Emulation]:
    """All buses by name, with the robots on them in the order of the scenario.

    `begin` makes what is told each tick from the robots of a bus.
    """
    by_bus: dict[str, list[Unit]] = {}
    for unit in units:
        by_bus.setdefault(unit.brief.bus, []).append(unit)
    return {bus: _emulation(brief, bus, group, begin(group)) for bus, group in by_bus.items()}


def _emulation(brief: PlantBrief, bus: str, units: Sequence[Unit], begin: Begin) -> Emulation:
    schedule = brief.schedule
    if brief.wire is None:
        return IdealBus(units, schedule, brief.substeps, begin)
    step_ns = schedule.period_ns // brief.substeps
    random = Random(f"{brief.seed}/{bus}/firmware")
    return WireBus(units, schedule, brief.wire, step_ns, begin, random)
