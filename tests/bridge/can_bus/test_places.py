"""Where sockets live."""

from pathlib import Path

import pytest

from bridge.can_bus import places
from configs.errors import InfrastructureError


def test_a_run_folder_is_private_and_goes_with_everything_in_it(runtime_folder: Path) -> None:
    folder = places.create_run_folder("run")
    assert folder.stat().st_mode & 0o777 == 0o700
    listeners = places.listen(folder, ("r1",))
    assert places.live_buses() == [folder / "r1.can"]
    for listener in listeners.values():
        listener.close()
    assert places.live_buses() == []
    places.remove_run_folder(folder)
    places.remove_run_folder(folder)
    assert not runtime_folder.exists()


def test_two_runs_of_one_name_are_refused() -> None:
    places.create_run_folder("run")
    with pytest.raises(InfrastructureError, match="can't make the run's folder"):
        places.create_run_folder("run")


def test_a_socket_in_use_is_named() -> None:
    folder = places.create_run_folder("run")
    (folder / "r1.can").touch()
    with pytest.raises(InfrastructureError, match=r"can't open bus r1 at .*r1\.can"):
        places.listen(folder, ("r1",))


def test_a_path_too_long_for_a_socket_says_what_to_set(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("FLEETLOOP_RUNTIME", str(tmp_path / ("x" * 100)))
    folder = places.create_run_folder("run")
    with pytest.raises(InfrastructureError, match="set FLEETLOOP_RUNTIME"):
        places.listen(folder, ("r1",))


def test_a_bus_name_that_two_runs_have_must_be_qualified() -> None:
    listeners = [places.listen(places.create_run_folder(run), ("r1",)) for run in ("a", "b")]
    with pytest.raises(places.NoSuchBusError, match="name one of a/r1, b/r1"):
        places.find("r1")
    assert places.find("b/r1").parent.name == "b"
    for listener in listeners:
        listener["r1"].close()
