"""What is found on a machine."""

import fcntl
import os
from pathlib import Path

import pytest
from support.clocks import ManualClock

from bridge.can_bus import sockets
from fleetloop.doctor import probes


class LateClock(ManualClock):
    """Every sleep takes longer than asked, by what comes next."""

    late_s = 0.0

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds + self.late_s)


def test_wake_ups_are_late_by_what_the_clock_says() -> None:
    clock = LateClock(10**9)
    clock.late_s = 0.0004
    measured = probes.wake_ups(0.001, 0.1, clock)
    assert len(measured.late_s) == 100
    assert measured.late_s == pytest.approx([0.0004] * 100, abs=1e-8)


def test_what_is_overdue_is_skipped_and_does_not_make_the_next_one_late() -> None:
    clock = LateClock(10**9)
    clock.late_s = 0.0025
    measured = probes.wake_ups(0.001, 0.01, clock)
    assert measured.late_s == pytest.approx([0.0025] * 10, abs=1e-8)


def process(proc: Path, pid: int, title: bytes, parent: int, uid: int | None = None) -> None:
    folder = proc / str(pid)
    folder.mkdir()
    uid = os.getuid() if uid is None else uid
    (folder / "cmdline").write_bytes(title + b"\0")
    (folder / "stat").write_text(f"{pid} (fleetloop age) S {parent} 1 1 0 -1 0 0 0 0 0 2 1\n")
    (folder / "status").write_text(f"Name:\tx\nUid:\t{uid}\t{uid}\t{uid}\t{uid}\n")
    (folder / "comm").write_text("systemd\n" if title == b"systemd --user" else "x\n")


def test_lone_roles_are_those_of_this_user_whose_parent_is_the_first_process(tmp_path) -> None:
    process(tmp_path, 1, b"init", 0)
    process(tmp_path, 40, b"systemd --user", 1)
    process(tmp_path, 50, b"python -m fleetloop run paper", 40)
    process(tmp_path, 51, b"fleetloop agent r1", 50)  # of a run that goes on
    process(tmp_path, 52, b"fleetloop agent r2", 1)
    process(tmp_path, 53, b"fleetloop plant", 40)
    process(tmp_path, 54, b"fleetloop recorder", 1, uid=os.getuid() + 1)
    process(tmp_path, 55, b"fleetloopholes agent", 1)
    (tmp_path / "56").mkdir()  # it ends just now
    assert probes.lone_roles(tmp_path) == [(52, "agent r2"), (53, "plant")]


def test_can_interfaces_are_known_by_their_type(tmp_path) -> None:
    for name, kind in (("lo", "772"), ("vcan1", "280"), ("can0", "280")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
    assert probes.can_interfaces(tmp_path) == ["can0", "vcan1"]


@pytest.fixture
def base(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("FLEETLOOP_RUNTIME", str(tmp_path / "fl"))
    return tmp_path / "fl"


def test_a_run_is_dead_when_its_lock_is_free(base: Path) -> None:
    for name in ("dead", "live"):
        sockets.create_run_folder(name)
        (base / name / sockets.LOCK).touch()
    with (base / "live" / sockets.LOCK).open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert probes.dead_runs() == ["dead"]


def test_trying_the_folder_for_sockets_leaves_nothing(base: Path) -> None:
    assert probes.bus_problem() == ""
    assert not base.exists()


def test_a_folder_for_sockets_that_is_too_deep_is_a_problem(base: Path, monkeypatch) -> None:
    monkeypatch.setenv("FLEETLOOP_RUNTIME", str(base / ("d" * 100)))
    assert "longer than" in probes.bus_problem()
    base.mkdir(exist_ok=True)
    base.chmod(0o777)
    monkeypatch.setenv("FLEETLOOP_RUNTIME", str(base))
    assert "can be written by others" in probes.bus_problem()


def test_priority_is_as_it_was_afterwards() -> None:
    before = os.sched_getscheduler(0)
    with probes.realtime_priority() as allowed:
        assert (os.sched_getscheduler(0) == os.SCHED_FIFO) is allowed
    assert os.sched_getscheduler(0) == before


def test_this_installation_is_whole() -> None:
    assert probes.loopback_problem() == ""
    assert probes.package_problem() == ""
    assert probes.registered()
    assert dict(probes.versions()).keys() >= {"fleetloop", "eclipse-zenoh", "python-can", "Python"}
    assert (probes.free_bytes(Path("/tmp")) or 0) > 0
