"""`--protocol` of `list` and `dump`: the frames of a drive protocol of one's own."""

import json

import pytest
from support.second_drive import ROW
from typer.testing import CliRunner

from bridge.frame import Frame
from configs.errors import ScenarioError
from fleetloop.can.app import app
from fleetloop.can.decoder import protocol_of

OWN = "own_drive:ROW"


@pytest.fixture
def here(tmp_path, monkeypatch) -> None:
    """A current folder with a protocol."""
    (tmp_path / "own_drive.py").write_text("from support.second_drive import ROW\n")
    (tmp_path / "broken_drive.py").write_text("ROW = (\n")
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("here")
def test_a_module_of_the_current_folder_is_found() -> None:
    assert protocol_of(OWN) is ROW


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("odriv", "did you mean odrive?"),
        ("canopen", "from module.py in the current folder"),
        ("no_drive:ROW", "no no_drive.py in"),
        ("own_drive:COL", "own_drive.py has no COL; it has ROW"),
        ("broken_drive:ROW", "broken_drive.py, line 1: "),
    ],
)
@pytest.mark.parametrize("verb", [("list",), ("dump", "any")])
def test_a_wrong_name_is_refused(verb: tuple[str, ...], name: str, words: str) -> None:
    done = CliRunner().invoke(app, [*verb, "--protocol", name])
    assert isinstance(done.exception, ScenarioError)
    assert str(done.exception).startswith(f"--protocol {name}: ")
    assert words in str(done.exception)


@pytest.mark.usefixtures("here")
def test_dump_decodes_it(buses, in_background) -> None:
    said: list[str] = []
    words = ["dump", "r1", "--decode", "--protocol", OWN, "-n", "1"]
    dumped = in_background(lambda: said.append(CliRunner().invoke(app, words).output))
    buses.await_clients(1)
    buses.deliver(Frame(0x105, bytes(8)))
    dumped.join(20.0)
    assert said[0].endswith("plain node 5\n")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("name", "nodes", "others"), [(OWN, [5], 0), ("odrive", [8], 0)])
def test_list_counts_its_nodes(buses, in_background, name: str, nodes, others: int) -> None:
    said: list[str] = []
    words = ["list", "--json", "--seconds", "1", "--protocol", name]
    listed = in_background(lambda: said.append(CliRunner().invoke(app, words).output))
    buses.await_clients(2)
    while listed.is_alive():
        buses.deliver(Frame(0x105, bytes(8)))
        listed.join(0.01)
    report = json.loads(said[0])[0]
    assert [node["node"] for node in report["nodes"]] == nodes
    assert report["other_frames"] == others
