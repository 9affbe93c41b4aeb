"""Emulation of cooperating differential-drive robots: scenarios, runs and what they came to.

    import fleetloop

    scenario = fleetloop.load("two_robots").with_(control={"k1": 3.0}, until_s=5.0)
    run = fleetloop.run(scenario)
    run.verdict, run["r1"].x_m, run.signal("x_e_m"), run.units["x_e_m"]

`load`, `shipped`, `Scenario`    scenarios: `configs.loading`, `configs.scenario`
`run`, `Progress`                `fleetloop.api.running`
`Run`, `NotHeldError`            a run that has ended: `fleetloop.api.result`
`FleetloopError` and below       `configs.errors`

Every process of a run imports this package: a name is imported when it is used.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from configs.errors import FleetloopError, InfrastructureError, ScenarioError
    from configs.loading import load, shipped
    from configs.scenario import Scenario
    from fleetloop.api.result import NotHeldError, Run
    from fleetloop.api.running import Progress, run
    from fleetloop.api.signals import RobotSignals

__all__ = [
    "FleetloopError",
    "InfrastructureError",
    "NotHeldError",
    "Progress",
    "RobotSignals",
    "Run",
    "Scenario",
    "ScenarioError",
    "load",
    "run",
    "shipped",
]

_PLACES = {
    "FleetloopError": "configs.errors",
    "InfrastructureError": "configs.errors",
    "NotHeldError": "fleetloop.api.result",
    "Progress": "fleetloop.api.running",
    "RobotSignals": "fleetloop.api.signals",
    "Run": "fleetloop.api.result",
    "Scenario": "configs.scenario",
    "ScenarioError": "configs.errors",
    "load": "configs.loading",
    "run": "fleetloop.api.running",
    "shipped": "configs.loading",
}


def __getattr__(name: str) -> object:
    """A name of `__all__`, the first time that it is used."""
    if name == "__version__":
        from importlib.metadata import version

        return version("fleetloop")
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    from fleetloop import packages

    packages.refuse_others()
    value = globals()[name] = getattr(import_module(_PLACES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
