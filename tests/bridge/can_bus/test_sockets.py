"""Where sockets live."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from bridge.can_bus import sockets
from configs.errors import InfrastructureError


def test_a_run_folder_is_private_and_goes_with_everything_in_it(runtime_folder: Path) -> None:
    folder = sockets.create_run_folder("run")
    assert folder.stat().st_mode & 0o777 == 0o700
    listeners = sockets.listen(folder, ("r1",))
    assert sockets.live_buses() == [folder / "r1.can"]
    for listener in listeners.values():
        listener.close()
    assert sockets.live_buses() == []
    sockets.remove_run_folder(folder)
    sockets.remove_run_folder(folder)
    assert not runtime_folder.exists()


def test_two_runs_of_one_name_are_refused() -> None:
    sockets.create_run_folder("run")
    with pytest.raises(InfrastructureError, match="can't make the run's folder"):
        sockets.create_run_folder("run")


def test_a_socket_in_use_is_named() -> None:
    folder = sockets.create_run_folder("run")
    (folder / "r1.can").touch()
    with pytest.raises(InfrastructureError, match=r"can't open bus r1 at .*r1\.can"):
        sockets.listen(folder, ("r1",))


def test_a_path_too_long_for_a_socket_says_what_to_set(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("FLEETLOOP_RUNTIME", str(tmp_path / ("x" * 100)))
    folder = sockets.create_run_folder("run")
    with pytest.raises(InfrastructureError, match="set FLEETLOOP_RUNTIME"):
        sockets.listen(folder, ("r1",))


def test_a_bus_name_that_two_runs_have_must_be_qualified() -> None:
    listeners = [sockets.listen(sockets.create_run_folder(run), ("r1",)) for run in ("a", "b")]
    with pytest.raises(sockets.NoSuchBusError, match="name one of a/r1, b/r1"):
        sockets.find("r1")
    assert sockets.find("b/r1").parent.name == "b"
    for listener in listeners:
        listener["r1"].close()


def test_a_relative_base_names_the_same_sockets_from_everywhere(monkeypatch, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FLEETLOOP_RUNTIME", "sockets")
    assert sockets.folder_of("run") == tmp_path / "sockets" / "run"


def test_a_relative_xdg_runtime_folder_is_ignored(monkeypatch) -> None:
    monkeypatch.delenv("FLEETLOOP_RUNTIME")
    monkeypatch.setenv("XDG_RUNTIME_DIR", "here")
    assert sockets.base_folder() == Path(f"/tmp/fleetloop-{os.getuid()}")


def _link(base: Path) -> None:
    (base.parent / "elsewhere").mkdir(mode=0o700)
    base.symlink_to(base.parent / "elsewhere")


def _open_to(mode: int, base: Path) -> None:
    base.mkdir()
    base.chmod(mode)


@pytest.mark.parametrize(
    ("prepare", "words"),
    [
        (_link, "is a symbolic link"),
        (lambda base: _open_to(0o777, base), r"can be written by others \(mode 0777\); chmod 700"),
        (lambda base: _open_to(0o1777, base), r"can be written by others \(mode 1777\)"),
        (lambda base: _open_to(0o770, base), r"can be written by others \(mode 0770\)"),
    ],
)
def test_a_base_in_which_others_could_pretend_to_be_a_bus_is_refused(
    prepare, words: str, runtime_folder: Path
) -> None:
    prepare(runtime_folder)
    with pytest.raises(InfrastructureError, match=words):
        sockets.create_run_folder("run")
    with pytest.raises(sockets.NoSuchBusError, match=words):
        sockets.find("r1")
    assert sockets.live_buses() == []
    assert list(runtime_folder.iterdir()) == []


@pytest.mark.skipif(os.getuid() != 0, reason="only root makes files of somebody else")
def test_a_base_of_somebody_else_is_refused(runtime_folder: Path) -> None:
    runtime_folder.mkdir(mode=0o700)
    os.chown(runtime_folder, 12345, 12345)
    with pytest.raises(InfrastructureError, match="belongs to user 12345; set FLEETLOOP_RUNTIME"):
        sockets.create_run_folder("run")


def test_a_base_that_others_may_only_read_is_taken(runtime_folder: Path) -> None:
    _open_to(0o755, runtime_folder)
    folder = sockets.create_run_folder("run")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_the_next_start_sweeps_what_a_killed_run_left_and_nothing_else(
    runtime_folder: Path,
) -> None:
    script = "import os\nfrom bridge.can_bus import sockets\n"
    script += "with sockets.run_folder('dead') as folder:\n"
    script += "    sockets.listen(folder, ('r1',))\n    os._exit(0)\n"
    with sockets.run_folder("alive") as alive, (runtime_folder / "notes").open("w"):
        subprocess.run([sys.executable, "-c", script], timeout=30, check=True)
        (runtime_folder / "mine").mkdir()
        assert (runtime_folder / "dead" / "r1.can").exists()
        with sockets.run_folder("next"):
            assert sorted(path.name for path in runtime_folder.iterdir()) == [
                "alive",
                "mine",
                "next",
                "notes",
            ]
            assert (alive / sockets.LOCK).exists()
