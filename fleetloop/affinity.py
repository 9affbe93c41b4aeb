"""Which core each process of a lockstep run lives on, where cores are fewer than processes.

A plant's tick costs about 0.6 of a controller's for each robot. With N controllers on C cores every
core takes 1.6 N/C: the plant's own takes as many controllers as still fit, the others share the
rest in turn. Left to the scheduler, processes wander between cores and take turns waking each other
up: a twentieth of a tick, measured on two cores. Launcher and recorder go where there is room.
"""

from collections.abc import Sequence

PLANT_SHARE = 0.6


def cores_of(controllers: int, cores: Sequence[int]) -> tuple[int | None, list[int | None]]:
    """The plant's core and each controller's; None for all if there are cores for everybody."""
    if len(cores) < 2 or len(cores) > controllers:
        return None, [None] * controllers
    home, *others = cores
    plant = PLANT_SHARE * controllers
    beside = max(round((plant + controllers) / len(cores) - plant), 0)
    placed: list[int | None] = [home] * min(beside, controllers)
    placed += [others[n % len(others)] for n in range(controllers - len(placed))]
    return home, placed
