"""Clients that hold a role's credentials and say what they like: the run goes on, or names them."""

import json
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
import psutil
import pytest
from support.addresses import free_port
from support.processes import Run, completed

from bridge.network import keys
from bridge.network.client import open_client
from bridge.network.fault_orders import FaultOrder
from bridge.network.messages import PathState, Rows
from bridge.network.telemetry import BLOCK_TICKS
from bridge.network.zenoh_link import ZenohLink
from configs.connections import NetworkLink
from configs.faults.powertrains import DriveEvent
from configs.roles import AGENT, identity_of
from fleetloop.record.reader import Record

pytestmark = pytest.mark.system
SCENARIO = ("two_robots", "--set", "expect=[]")


class TellingRun(Run):
    """A run whose logins the test knows."""

    program = (str(Path(__file__).parents[1] / "support/telling_launcher.py"),)


class Attacked:
    """A run, and clients of it with anybody's login."""

    def __init__(self, run: Run, logins: Path, endpoint: str) -> None:
        self.run = run
        self.name, self._passwords = json.loads(logins.read_text())
        self._endpoint = endpoint

    def client(self, user: str) -> ZenohLink:
        return open_client(
            NetworkLink(self.name, self._endpoint, user, self._passwords[user]), 10.0
        )

    def key(self, of: Callable[[str, str], str], name: str) -> str:
        return of(self.name, name)


@contextmanager
def attacked(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *args: str, bus_time_s: float = 0.6
) -> Iterator[Attacked]:
    endpoint, logins = f"tcp/127.0.0.1:{free_port()}", folder / "logins"
    monkeypatch.setenv("FLEETLOOP_TEST_LOGINS", str(logins))
    where = ("--set", f'network.endpoint="{endpoint}"')
    run = TellingRun(folder / "run", *SCENARIO, *where, *args)
    try:
        run.await_bus_time(bus_time_s)
        yield Attacked(run, logins, endpoint)
    finally:
        run.kill()


def notices(run: Run) -> str:
    return json.dumps(run.summary()["notices"], ensure_ascii=False)


def test_lies_about_a_path_variable_move_nobody_and_are_named(tmp_path, monkeypatch) -> None:
    with attacked(tmp_path, monkeypatch, "--duration", "6", "--speed", "1") as attack:
        with attack.client(AGENT.identity("r1")) as r1:
            mouth = r1.publisher(attack.key(keys.path, "r1"))
            for share in range(0, 100, 10):
                for state in (
                    PathState(share + 1_800_000, (share + 1_800_000) * 2_000_000, 1800.0, 0.6),
                    PathState(share, 3600 * 10**9, 0.0, 0.6),
                    PathState(-(2**62), -(2**62), 1e308, -1e308),
                    PathState(2**62, 2**62, -1e308, 1e308),
                ):
                    mouth.put(state.encode())
            mouth.put(b"\xc1")
        status, out = attack.run.end()
    assert status == 0, out
    said = notices(attack.run)
    for words in ("path states of r1: dated 3599", "is not at 3600 s", "r1: not well formed"):
        assert words in said
    rows = Record.open(tmp_path / "run" / "record.mcap").controller["r2"]
    assert abs(rows["s"]).max() < 10.0


def test_a_state_in_a_neighbours_place_ends_the_run_with_its_name_or_not_at_all(
    tmp_path, monkeypatch
) -> None:
    with attacked(tmp_path, monkeypatch, "--speed", "1") as attack:
        with attack.client(AGENT.identity("r1")) as r1:
            mouth = r1.publisher(attack.key(keys.path, "r1"))
            for tick in range(0, 15_000, 10):
                mouth.put(PathState(tick, tick * 2_000_000, 1e6, 0.6).encode())
        status, out = attack.run.end()
    assert status == 0 or "no path state of r1; refused" in out, out
    assert re.search(r"path states? of r1: s = 1e\+06 m", notices(attack.run))


def test_nonsense_in_a_roles_report_and_progress_ends_nothing(tmp_path, monkeypatch) -> None:
    with attacked(tmp_path, monkeypatch, "--duration", "3", "--speed", "1") as attack:
        for role in ("agent/r1", "recorder", "plant"):
            with attack.client(identity_of(role)) as link:
                report = link.publisher(attack.key(keys.report, role))
                progress = link.publisher(attack.key(keys.progress, role))
                honest = ["", "", ["\x1b[2J\x1b]0;owned\x07"], [], [], 0, {}, {}]
                own = {"plant": [0, {}, {}, {}, [], {}], "agent/r1": ["", 0, None, {}]}.get(
                    role, []
                )
                report.put(msgpack.packb([1, *honest, *own]))
                for wrong in (
                    [1, *honest[:5], float("nan"), {}, {}, *own],
                    [1, *honest[:6], {"x": 1e300}, {}, *own],
                    [1, *honest[:7], {f"n{n}": n for n in range(5000)}, *own],
                    [1, ["x"], *honest[1:], *own],
                    [1, {"misses": float("inf")}],
                ):
                    report.put(msgpack.packb(wrong))
                progress.put(msgpack.packb([1, 2**62, 2**62, -1, None]))
                report.put(b"\xc1")
        status, out = attack.run.end()
    assert status == 0, out
    assert "Traceback" not in out
    assert "\x1b" not in out + notices(attack.run)
    assert "reports of agent/r1: not well formed" in out
    assert "tick 4611686018427387904" in out


def test_ten_megabytes_and_floods_on_ones_own_keys_end_no_run_or_name_their_sender(
    tmp_path, monkeypatch
) -> None:
    with attacked(tmp_path, monkeypatch, "--duration", "8") as attack:
        started = [psutil.Process(p.pid) for p in attack.run.launcher.children(recursive=True)]
        before = {p.pid: p.memory_info().rss for p in (*started, attack.run.launcher)}
        most: dict[int, int] = dict(before)
        with attack.client(AGENT.identity("r1")) as r1:
            own = [r1.publisher(attack.key(of, "r1")) for of in (keys.path, keys.telemetry)]
            own += [r1.publisher(attack.key(of, "agent/r1")) for of in (keys.progress, keys.report)]
            for mouth in own:
                for _ in range(5):
                    mouth.put(bytes(10_000_000))
            state = PathState(10, 20_000_000, 0.0, 0.6).encode()
            row = Rows(2**40, 1, bytes(8), False).encode()
            said = [state, row, b"progress", b"report"]
            began = time.monotonic()
            while attack.run.launcher.is_running() and time.monotonic() < began + 5.0:
                for _ in range(500):
                    for mouth, payload in zip(own, said, strict=True):
                        mouth.put(payload)
                for process in (*started, attack.run.launcher):
                    try:
                        most[process.pid] = max(most[process.pid], process.memory_info().rss)
                    except psutil.Error:
                        continue
        status, out = attack.run.end()
    assert "Traceback" not in out
    assert status == 0 or re.search("verdict  aborted: .*; flooded by .*r1", out), out
    assert max(most[pid] - before[pid] for pid in before) < 300e6
    assert re.search("(of|cut off) .*r1", notices(attack.run))


def test_a_hearer_with_rights_that_does_not_read_stops_nobody(tmp_path, monkeypatch) -> None:
    import zenoh

    from bridge.network.client import _login_config

    with attacked(tmp_path, monkeypatch, "--duration", "20") as attack:
        login = NetworkLink(
            attack.name, attack._endpoint, "recorder", attack._passwords["recorder"]
        )
        ears = zenoh.open(_login_config("client", login, 10.0))
        unread = [
            ears.declare_subscriber(attack.key(of, robot), zenoh.handlers.FifoChannel(1))
            for robot in ("r1", "r2")
            for of in (keys.truth, keys.telemetry)
        ]
        status, out = attack.run.end()
        for subscriber in unread:
            subscriber.undeclare()
        ears.close()
    assert status == 0, out


def test_what_is_said_on_the_network_for_a_process_on_this_machine_is_not_recorded(
    tmp_path, monkeypatch
) -> None:
    with attacked(tmp_path, monkeypatch, "--duration", "2", "--speed", "1") as attack:
        with attack.client(AGENT.identity("r1")) as r1:
            # One that ends, one in every place, one that gives up the place of many.
            for first in range(0, 4000, BLOCK_TICKS):
                for rows in (Rows(first, 0, b"", True), Rows(first, 1, bytes(4096), False)):
                    r1._session.put(attack.key(keys.telemetry, "r1"), rows.encode())
        status, out = attack.run.end()
    assert status == 0, out
    assert "recorder" not in attack.run.summary()["notices"]
    alone = tmp_path / "alone"
    assert completed(alone, *SCENARIO, "--duration", "2", "--in-process")[0] == 0
    said, true = (
        Record.open(folder / "record.mcap").controller["r1"]
        for folder in (attack.run.folder, alone)
    )
    assert said.tobytes() == true.tobytes()


def test_only_the_launcher_orders_faults(tmp_path, monkeypatch) -> None:
    estop = DriveEvent(kind="drive_estop", at_s=0.0)
    order = FaultOrder(1, False, "stop", ("r1", "r2"), estop, 0, None, False).encode()
    with attacked(tmp_path, monkeypatch, "--duration", "3", "--speed", "1") as attack:
        with attack.client(AGENT.identity("r1")) as r1:
            for process in ("plant", "agent/r2", "agent/r1"):
                r1._session.put(attack.key(keys.order, process), order)
            r1.publisher(attack.key(keys.answer, "agent/r1")).put(b"\xc1")
        status, out = attack.run.end()
    assert status == 0, out
    assert attack.run.summary()["stopped_robots"] == {}
    assert "answer of agent/r1: not well formed" in notices(attack.run)
