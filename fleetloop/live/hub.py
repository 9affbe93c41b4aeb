"""All viewers of one run: who has the controls, what is told to each, orders on their way.

The hub lives in the loop of the server. It settles the picture once a frame for all viewers, and
only while there are any; what costs more (expectations) waits so long that it stays a small share.
"""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any, Protocol

from bokeh.document import Document

from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.errors import FleetloopError
from configs.events import KINDS
from fleetloop.live.form import kinds_of
from fleetloop.live.orders import ESTOP, RELEASE, TAKE, Controls, Order, parsed
from fleetloop.live.page import FRAME_MS, Page
from fleetloop.live.state import LiveState

MOST_VIEWERS = 8
MOST_PAGES = 40
"""That are loaded, with those whose browser isn't there yet, or no longer."""
MOST_ORDERS = 4
"""Of one viewer that are on their way."""
_JUDGE_EVERY_S = 1.0
_IDLE_SETTLE_S = 2.0
_WHO = "the live page"
"""In the controls of the run."""
_JUDGE_SHARE = 0.02
"""The most of the time that goes into judging expectations."""


class Desk(Protocol):
    """The run's side of orders."""

    async def ask(self, request: str, **arguments: Any) -> Mapping[str, Any]:
        """Carry out a request; the answer.

        Raises:
            FleetloopError: it is refused, or the run has ended.
        """


class Viewer:
    """One browser."""

    def __init__(self, name: str, page: Page) -> None:
        self.name = name
        self.page = page
        self.there = False
        self.answers: list[dict[str, Any]] = []
        self.orders: Counter[str] = Counter()


class Hub:
    """The viewers of one run.

    Args:
        state: what they see.
        desk: carries out their orders.
        run: name of the run.
        clock: of frames.
    """

    def __init__(
        self, state: LiveState, desk: Desk, run: str, *, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self.state = state
        self.controls = Controls()
        self.viewers: dict[str, Viewer] = {}
        self._desk = desk
        self._about = {"run": run, "kinds": kinds_of(state.scenario)}
        self._clock = clock
        self._count = 0
        self._tasks: set[asyncio.Task[None]] = set()  # orders on their way
        self._settled_s = self._judged_s = 0.0
        self._judging_s = _JUDGE_EVERY_S
        self._concluded = False

    # --- viewers ----------------------------------------------------------------------------------

    def open(self, document: Document) -> None:
        """Make the document of a viewer that comes."""
        self._count += 1
        page = Page(document, self.state, self._about)
        viewer = Viewer(f"viewer {self._count}", page)
        context = document.session_context
        session = str(id(document) if context is None else context.id)
        self.viewers[session] = viewer
        page.on_order = partial(self._take_order, viewer)
        document.add_periodic_callback(lambda: self._push(viewer), FRAME_MS)
        document.on_session_destroyed(lambda _: self._close(session))

    def _close(self, session: str) -> None:
        viewer = self.viewers.pop(session, None)
        if viewer is not None:
            self.controls.release(viewer.name)

    def note_connections(self, connections: Mapping[str, int]) -> None:
        """Take how many connections each session has: a viewer that has gone controls nothing."""
        for session, viewer in self.viewers.items():
            there = connections.get(session, 0) > 0
            if viewer.there and not there:
                self.controls.release(viewer.name)
            viewer.there = there

    def count_there(self) -> int:
        """How many browsers are there."""
        return sum(viewer.there for viewer in self.viewers.values())

    @property
    def watched(self) -> bool:
        """Whether a browser is there."""
        return self.count_there() > 0

    def _push(self, viewer: Viewer) -> None:
        if not viewer.there:
            return
        if self._concluded:
            viewer.page.push_last(self.state, partial(self.board, viewer))
            return
        self.advance()
        viewer.page.push(self.state, partial(self.board, viewer))

    def idle(self) -> None:
        """Nobody looks: keep what waits small, every `_IDLE_SETTLE_S`."""
        now_s = self._clock.monotonic_s()
        if now_s - self._settled_s >= _IDLE_SETTLE_S:
            self._settled_s = now_s
            self.state.settle()

    def show(self, state: LiveState) -> None:
        """Show another picture of the run, with what was known beside its rows."""
        state.take_over(self.state)
        self.state = state

    def end(self) -> None:
        """The run has ended: no rows follow."""
        self.state.settle()
        self.state.judge()
        self.state.ended = True

    def conclude(self, summary: Mapping[str, Any] | None) -> None:
        """Give each viewer the last of everything, with the run's verdict if it has a summary."""
        if summary is not None:
            self.state.conclude(summary)
        self._concluded = True

    async def shown(self, within_s: float) -> None:
        """Wait until all browsers that are there have drawn the last frame, at most so long."""
        deadline_s = self._clock.monotonic_s() + within_s
        while self._clock.monotonic_s() < deadline_s and any(
            viewer.there and not viewer.page.has_last for viewer in self.viewers.values()
        ):
            await asyncio.sleep(0.02)

    def advance(self) -> None:
        """Bring the picture up to date, at most once a frame."""
        now_s = self._clock.monotonic_s()
        if now_s - self._settled_s < 0.5e-3 * FRAME_MS:
            return
        self._settled_s = now_s
        self.state.settle()
        if now_s - self._judged_s >= self._judging_s:
            self._judged_s = now_s
            self.state.judge()
            took_s = self._clock.monotonic_s() - now_s
            self._judging_s = max(_JUDGE_EVERY_S, took_s / _JUDGE_SHARE)

    # --- what a viewer is told --------------------------------------------------------------------

    def board(self, viewer: Viewer, since: int) -> dict[str, Any]:
        """What is told beside the frames: with the events from a number on."""
        state = self.state
        answers, viewer.answers = viewer.answers, []
        period_s = state.schedule.period_s
        events = [
            {
                "t_s": event.tick * period_s,
                "source": event.source,
                "kind": event.kind,
                "text": event.text,
                "gravity": KINDS[event.kind].gravity.name.lower(),
            }
            for event in state.events[since:]
        ]
        return {
            "run": state.status,
            "ended": state.ended,
            "seen_from_s": state.seen_from_s,
            "verdict": state.verdict,
            "controls": {
                "you": viewer.name,
                "yours": self.controls.holder == viewer.name,
                "holder": self.controls.holder,
                "outside": self._outside(),
            },
            "viewers": len(self.viewers),
            "expectations": state.expectations.judged,
            "faults": list(state.faults),
            "events": {"first": since, "next": len(state.events), "items": events},
            "answers": answers,
        }

    # --- orders -----------------------------------------------------------------------------------

    def _take_order(self, viewer: Viewer, text: object) -> None:
        """Take what a browser has sent as an order; the answer goes to the same one."""
        try:
            order = parsed(text)
        except FleetloopError as error:
            viewer.answers.append({"id": None, "error": str(error)})
            return
        if viewer.orders.total() >= MOST_ORDERS:
            wrong = f"{MOST_ORDERS} orders are on their way already"
            viewer.answers.append({"id": order.number, "error": wrong})
            return
        viewer.orders[order.request] += 1

        async def carry_out() -> None:
            try:
                answer = await self.carry_out(viewer.name, order)
            finally:
                viewer.orders[order.request] -= 1
            viewer.answers.append({"id": order.number, **answer})

        task = asyncio.create_task(carry_out())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def carry_out(self, viewer: str, order: Order) -> dict[str, Any]:
        """Carry out an order of a viewer: said, or error."""
        try:
            if order.request == TAKE:
                return await self._take_controls(viewer)
            if order.request == RELEASE:
                self.controls.release(viewer)
                if self.controls.holder is None:
                    await self._desk.ask(RELEASE)
                return {"said": ""}
            self.controls.check(viewer)
            said = await self._ask(order)
        except FleetloopError as error:
            return {"error": str(error)}
        return {"said": _in_words(order, said)}

    async def _take_controls(self, viewer: str) -> dict[str, Any]:
        """The run's controls for this page, and the page's for a viewer."""
        await self._desk.ask(TAKE, who=f"{_WHO} ({viewer})")
        self.controls.take(viewer)
        return {"said": ""}

    def _outside(self) -> str | None:
        """Who has the run's controls beside this page."""
        holder = self.state.status.get("controller")
        return None if holder is None or str(holder).startswith(_WHO) else str(holder)

    async def _ask(self, order: Order) -> Mapping[str, Any]:
        ask: Callable[..., Awaitable[Mapping[str, Any]]] = self._desk.ask
        if order.request == ESTOP:
            return await ask("fault.inject", fault={"kind": "drive_estop"})
        return await ask(order.request, **order.arguments)


def _in_words(order: Order, said: Mapping[str, Any]) -> str:
    """What has come of an order, for people."""
    match order.request:
        case "fault.inject" | "estop":
            fault = said.get("fault", {})
            return f"{fault.get('name')}: acts from {fault.get('from_s')} s on"
        case "fault.clear":
            names = [str(one.get("name")) for one in said.get("cleared", [])]
            return f"cleared: {', '.join(names) or 'nothing'}"
        case "run.leader_speed":
            return f"v_r changes from tick {said.get('tick')} on"
    return ""
