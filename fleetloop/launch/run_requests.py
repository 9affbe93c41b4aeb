"""What may be asked of a run through its door.

request    arguments    answer
about      -            run, folder, scenario, tick, t_s: which run it is, and how far
fault...                see `fleetloop.launch.fault_desk`
live...                 see `fleetloop.launch.viewer`
"""

from collections.abc import Mapping

from fleetloop.door.requests import Request, Respond
from fleetloop.launch.fault_desk import FaultDesk
from fleetloop.launch.spawn import Orders
from fleetloop.launch.viewer import Viewer


def run_requests(
    run: str, orders: Orders, desk: FaultDesk, viewer: Viewer
) -> Mapping[str, Request]:
    """The table of requests of one run."""

    def about(respond: Respond) -> None:
        tick, t_s = desk.now()
        folder, name = str(orders.record.parent.absolute()), orders.scenario.name
        respond({"run": run, "folder": folder, "scenario": name, "tick": tick, "t_s": t_s})

    return {"about": Request({}, about), **desk.requests, **viewer.requests}
