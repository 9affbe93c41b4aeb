"""What may be asked of a run through its door.

request      arguments    answer
about        -            run, folder, scenario, tick, t_s: which run it is, and how far
run...                    see `fleetloop.launch.steering` and `fleetloop.launch.run_status`
fault...                  see `fleetloop.launch.fault_desk`
live...                   see `fleetloop.launch.viewer`
controls...               see `fleetloop.door.controls`
"""

from collections.abc import Callable, Iterable, Mapping

from bridge.network.link import Link
from configs.brief import Schedule
from configs.roles import LAUNCHER
from fleetloop.door.controls import Controls
from fleetloop.door.requests import Request, Respond
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.fault_desk import FaultDesk
from fleetloop.launch.order_book import OrderBook
from fleetloop.launch.run_status import RunStatus
from fleetloop.launch.spawn import Orders
from fleetloop.launch.steering import Steering
from fleetloop.launch.viewer import Viewer


class RunRequests:
    """The desks of one run, which carry out what is asked of it.

    Args:
        orders: of the run.
        schedule: of the run.
        plane: of the run.
        viewer: of the run.
    """

    def __init__(
        self, orders: Orders, schedule: Schedule, plane: ControlPlane, viewer: Viewer
    ) -> None:
        self._orders = orders
        self._viewer = viewer
        self.controls = Controls()

        def tick() -> int:
            return plane.outcome.ticks

        def is_absent(process: str) -> bool:
            """What a fault has ended or frozen is absent before that is seen."""
            by_faults = self.faults.ledger.absent(tick(), schedule.ticks)
            return process in plane.absent or process in by_faults

        self._book = book = OrderBook(schedule, is_absent, tick, plane.now)
        self.steering = Steering(
            orders.scenario,
            orders.speed,
            book,
            lambda kind, text, at: plane.note(LAUNCHER.name, kind, text, at),
        )
        self.faults = FaultDesk(
            orders.scenario,
            orders.deployment.fault_problem,
            book,
            lambda: self.steering.paused,
        )
        self.status = RunStatus(plane, book, orders.scenario.ends_at_s, self.steering)
        self.status.controller = lambda: self.controls.controller
        plane.on_answer, plane.on_alive = book.take, self._repeat

    def open(self, link: Link, run: str, processes: Iterable[str]) -> None:
        """Declare what orders and answers need."""
        self._book.open(link, run, processes)

    def _repeat(self, process: str) -> None:
        """Tell a process that is there, or there again, what it doesn't know."""
        self._book.repeat(process)
        self.faults.repeat(process)
        self.steering.repeat(process)

    def look(self) -> None:
        """Answer what is due."""
        self._book.look()
        self.faults.look()
        self._viewer.look()

    def end(self) -> None:
        """Answer what can still be answered: the run has ended."""
        self.faults.end()

    def of_run(self, run: str, stop: Callable[[str], None]) -> Mapping[str, Request]:
        """The table of requests of one run; `stop` ends it, for a reason."""
        self.steering.on_stop = stop

        def about(respond: Respond) -> None:
            tick = self._book.tick()
            folder, name = str(self._orders.record.parent.absolute()), self._orders.scenario.name
            t_s = self._book.seconds(tick)
            respond({"run": run, "folder": folder, "scenario": name, "tick": tick, "t_s": t_s})

        return {
            "about": Request({}, about),
            **self.status.requests,
            **self.steering.requests,
            **self.faults.requests,
            **self._viewer.requests,
        }
