"""The server of a live page: whoever lacks the token, has another origin or not the controls."""

import asyncio
import base64
from collections.abc import Coroutine
from secrets import token_urlsafe
from typing import Any

import pytest
from support.live_client import HeadlessPage, session_token, socket_address
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest, HTTPResponse
from tornado.websocket import websocket_connect

from configs.errors import ScenarioError
from configs.events import Event
from configs.loading import load
from configs.scenario import Scenario
from fleetloop.live.hub import Hub
from fleetloop.live.page import MOST_UNDRAWN
from fleetloop.live.server import LiveServer
from fleetloop.live.state import LiveState


class WrittenDesk:
    """Writes down what it is asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, Any]]] = []
        self.refuses: set[str] = set()

    async def ask(self, request: str, **arguments: Any) -> dict[str, Any]:
        if request in self.refuses:
            raise ScenarioError("a shell has the controls")
        self.asked.append((request, arguments))
        return {}


class Bench:
    """A server with a picture of a run that stands still."""

    def __init__(self, scenario: Scenario) -> None:
        self.desk = WrittenDesk()
        self.hub = Hub(LiveState(scenario), self.desk, "<b>two</b>-000001")
        self.token = token_urlsafe()
        self.server = LiveServer(self.hub, self.token)
        self.address = self.server.address
        self.place = f"127.0.0.1:{self.server.port}"


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load("two_robots")


def served(scenario: Scenario, test: Any) -> None:
    """Run a test in the loop of a server."""

    async def run() -> None:
        bench = Bench(scenario)
        try:
            async with asyncio.timeout(60.0):
                await test(bench)
        finally:
            bench.server.stop()

    asyncio.run(run())


async def answer(url: str, method: str = "GET", **headers: str) -> HTTPResponse:
    body = "" if method == "POST" else None
    request = HTTPRequest(url, method=method, headers=headers, body=body)
    return await AsyncHTTPClient().fetch(request, raise_error=False)


async def refused(attempt: Coroutine[Any, Any, Any]) -> int:
    with pytest.raises(HTTPClientError) as caught:
        await attempt
    return int(caught.value.code)


def test_only_the_right_token_opens_the_page(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        base = f"http://{bench.place}/"
        assert (await answer(bench.address)).code == 200
        for wrong in ("", "?token=", f"?token={bench.token[:-1]}", f"?token={token_urlsafe()}"):
            said = await answer(base + wrong)
            assert said.code == 403
            assert b"token" in said.body
        doubled = f"{bench.address}&token={bench.token}"
        assert (await answer(doubled)).code == 403

    served(scenario, test)


def test_a_websocket_needs_the_token_and_a_session_of_a_page(
    scenario: Scenario, caplog: pytest.LogCaptureFixture
) -> None:
    async def test(bench: Bench) -> None:
        good = socket_address(bench.address)
        session = await session_token(bench.address)
        lacking = good.replace(f"token={bench.token}", "token=guess")
        assert await refused(websocket_connect(lacking, subprotocols=["bokeh", session])) == 403
        forged = session[:-4] + ("AAAA" if session[-4:] != "AAAA" else "BBBB")
        no_object = base64.urlsafe_b64encode(b"[]").decode().rstrip("=")
        for protocols in (
            ["bokeh", forged],
            ["bokeh", f"{no_object}.{no_object}"],
            ["bokeh", "x.y"],
            ["bokeh", "x"],
            ["bokeh"],
            [session],
            [],
            ["other", session],
        ):
            assert await refused(websocket_connect(good, subprotocols=protocols)) == 403
        assert (await answer(f"{bench.address}&bokeh-session-id=mine")).code == 400
        connection = await websocket_connect(good, subprotocols=["bokeh", session])
        assert await connection.read_message() is not None
        for part in ("header", "metadata", "content"):
            await connection.write_message(f"no {part}")
        while await connection.read_message() is not None:
            pass  # until it is closed
        connection.close()

    served(scenario, test)
    assert not caplog.records, "what is wrong with a request is told to its sender alone"


def test_another_origin_and_another_name_of_this_machine_are_refused(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        session = await session_token(bench.address)
        for origin in ("http://evil.example", f"http://evil.example:{bench.server.port}", "null"):
            headers = {"Origin": origin}
            request = HTTPRequest(socket_address(bench.address), headers=headers)
            attempt = websocket_connect(request, subprotocols=["bokeh", session])
            assert await refused(attempt) == 403
            assert (await answer(bench.address, **headers)).code == 403
        for host in (f"evil.example:{bench.server.port}", "127.0.0.1", "localhost"):
            assert (await answer(bench.address, Host=host)).code == 403

    served(scenario, test)


def test_there_is_the_page_and_nothing_else(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        for path in ("metadata", "autoload.js", "two", "ws/more"):
            url = bench.address.replace("/?", f"/{path}?")
            assert (await answer(url)).code == 404
        for method in ("POST", "HEAD"):
            assert (await answer(bench.address, method)).code == 405
        beyond = f"http://{bench.place}/static/../server.py"
        assert (await answer(beyond)).code in (403, 404)

    served(scenario, test)


def test_the_page_loads_nothing_from_elsewhere_and_has_names_as_text(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        page = await answer(bench.address)
        text = page.body.decode()
        policy = page.headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'self' 'unsafe-inline';")
        assert page.headers["Referrer-Policy"] == "no-referrer"
        assert page.headers["Cache-Control"] == "no-store"
        assert 'src="/static/js/bokeh.min.js' in text
        assert "https://" not in text
        assert "cdn" not in text
        assert "<b>two" not in text
        files = await answer(f"http://{bench.place}/static/js/bokeh.min.js")
        assert files.code == 200

    served(scenario, test)


def test_one_viewer_has_the_controls_and_orders_of_others_go_nowhere(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        one = await HeadlessPage.open(bench.address)
        assert (await one.order("run.pause"))["error"].startswith("nobody has the controls")
        assert "error" not in await one.order("controls.take")
        other = await HeadlessPage.open(bench.address)
        assert (await other.order("run.pause"))["error"] == "viewer 1 has the controls"
        board = await other.until(lambda it: it["controls"]["holder"] == "viewer 1")
        assert board["controls"]["you"] == "viewer 2"
        assert not board["controls"]["yours"]
        await one.order("run.step", ticks=3)
        assert bench.desk.asked[-1] == ("run.step", {"ticks": 3})
        await other.order("controls.take")
        assert (await one.order("run.pause"))["error"] == "viewer 2 has the controls"
        one.close()
        other.close()

    served(scenario, test)


def test_a_viewer_that_goes_leaves_the_controls_to_others(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        one = await HeadlessPage.open(bench.address)
        await one.order("controls.take")
        one.close()
        other = await HeadlessPage.open(bench.address)
        await other.until(lambda it: it["controls"]["holder"] is None)
        await other.order("controls.take")
        assert bench.hub.controls.holder == "viewer 2"
        other.close()

    served(scenario, test)


def test_controls_that_are_elsewhere_are_named(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        bench.desk.refuses.add("controls.take")
        bench.hub.state.status = {"controller": "a shell"}
        page = await HeadlessPage.open(bench.address)
        assert (await page.order("controls.take"))["error"] == "a shell has the controls"
        assert (await page.order("run.pause"))["error"].startswith("nobody has the controls")
        assert page.boards[-1]["controls"]["outside"] == "a shell"
        page.close()

    served(scenario, test)


def test_an_estop_is_a_fault_of_all_drives(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        page = await HeadlessPage.open(bench.address)
        await page.order("controls.take")
        await page.order("estop")
        assert bench.desk.asked[1:] == [("fault.inject", {"fault": {"kind": "drive_estop"}})]
        page.close()

    served(scenario, test)


def test_a_slow_browser_is_skipped_and_goes_on_where_it_is(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        page = await HeadlessPage.open(bench.address, draws=False)
        (viewer,) = bench.hub.viewers.values()
        while page.frames < MOST_UNDRAWN or viewer.page.skipped < 10:
            await page.take() if page.frames < MOST_UNDRAWN else await asyncio.sleep(0.01)
        assert page.frames == MOST_UNDRAWN
        page.set("heard", {"frame": [MOST_UNDRAWN]})
        while page.frames < 2 * MOST_UNDRAWN:
            await page.take()
        page.set("heard", {"frame": [1e9]})
        page.set("heard", {"frame": ["x"]})
        page.close()

    served(scenario, test)


def test_events_have_the_gravity_of_their_kind(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        for kind in ("diverged", "stopped", "joined"):
            bench.hub.state.note_events([Event(3, "r1", kind, "")])
        page = await HeadlessPage.open(bench.address)
        board = await page.until(lambda it: it["events"]["items"] != [])
        told = {one["kind"]: one["gravity"] for one in board["events"]["items"]}
        assert told == {"diverged": "error", "stopped": "warning", "joined": "info"}
        page.close()

    served(scenario, test)


def test_after_the_end_the_verdict_is_that_of_the_runs_summary(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        page = await HeadlessPage.open(bench.address)
        bench.hub.end()
        assert (await page.until(lambda it: it["ended"]))["verdict"] == ""
        judged = [{"claim": "it holds", "held": True}]
        bench.hub.conclude({"verdict": "interrupted", "expectations": judged})
        board = await page.until(lambda it: it["verdict"])
        assert (board["verdict"], board["expectations"]) == ("interrupted", judged)
        (viewer,) = bench.hub.viewers.values()
        while not viewer.page.has_last:
            await page.take()
        page.close()

    served(scenario, test)


def test_too_many_viewers_are_turned_away(
    scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fleetloop.live.server.MOST_VIEWERS", 1)

    async def test(bench: Bench) -> None:
        page = await HeadlessPage.open(bench.address)
        while bench.hub.count_there() < 1:
            await asyncio.sleep(0.01)
        said = await answer(bench.address)
        assert said.code == 503
        assert said.body == b"1 viewers are there already: close one, and load this again\n"
        page.close()
        while bench.hub.count_there():
            await asyncio.sleep(0.01)
        assert (await answer(bench.address)).code == 200

    served(scenario, test)


def test_who_loads_the_page_again_and_again_is_told_to_wait_only_after_many(
    scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {"MOST_VIEWERS": 1, "MOST_PAGES": 3, "_UNUSED_MS": 600_000}.items():
        monkeypatch.setattr(f"fleetloop.live.server.{name}", value)

    async def test(bench: Bench) -> None:
        for _ in range(3):
            assert (await answer(bench.address)).code == 200
        said = await answer(bench.address)
        assert (said.code, said.body) == (503, b"loaded too often: load this again in 600 s\n")

    served(scenario, test)


def test_too_long_a_message_is_a_viewers_last(scenario: Scenario) -> None:
    async def test(bench: Bench) -> None:
        page = await HeadlessPage.open(bench.address)
        page.set("orders", {"json": ["x" * (1 << 17)]})
        with pytest.raises(ConnectionError):
            while True:
                await page.take()
        page.close()

    served(scenario, test)
