"""The python-can interface `fleetloop` where python-can finds it, by an entry point, anywhere."""

from typing import TYPE_CHECKING

from fleetloop.packages import load_own

if TYPE_CHECKING:
    from bridge.can_bus.interface import FleetloopBus
else:
    FleetloopBus = load_own(
        "bridge.can_bus.interface",
        "bridge.can_bus.credentials",
        "bridge.can_bus.zenoh_transport",
    ).FleetloopBus

__all__ = ["FleetloopBus"]
