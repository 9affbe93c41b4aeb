"""The layout names channels and fields that the run's record has."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from configs.loading import load
from fleetloop.foxglove.layout import MOST_ROBOTS, layout_of

PATH = re.compile(r"(?P<topic>[a-z0-9_/]+)\.(?P<field>[a-z0-9_]+)(?:\[(?P<number>\d+)\])?")


@pytest.fixture(scope="module")
def layout(finished_run: Path) -> dict[str, Any]:
    return json.loads((finished_run / "layout.json").read_text())


def first_messages(record: Path) -> dict[str, Any]:
    """The first message of each topic."""
    found: dict[str, Any] = {}
    with record.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, content in reader.iter_decoded_messages():
            found.setdefault(channel.topic, content)
    return found


def test_every_plotted_series_is_a_number_of_the_record(
    finished_run: Path, layout: dict[str, Any]
) -> None:
    messages = first_messages(finished_run / "record.mcap")
    plots = [it for key, it in layout["configById"].items() if key.startswith("Plot!")]
    series = [one["value"] for plot in plots for one in plot["paths"]]
    assert len(series) == len(set(series)) == 2 * (2 + 1 + 2) + 3
    for path in series:
        said = PATH.fullmatch(path)
        assert said is not None, path
        value = getattr(messages[said["topic"]], said["field"])
        assert isinstance(value[int(said["number"])] if said["number"] else value, float)


def test_the_plane_shows_all_scenes_and_the_log_panel_the_log(
    finished_run: Path, layout: dict[str, Any]
) -> None:
    messages = first_messages(finished_run / "record.mcap")
    shown = layout["configById"]["3D!plane"]["topics"]
    assert shown == {t: {"visible": True} for t in sorted(messages) if t.startswith("scene/")}
    assert layout["configById"]["RosOut!events"]["topicToRender"] in messages


def test_the_types_of_panels_are_those_of_viewers(layout: dict[str, Any]) -> None:
    types = {panel.partition("!")[0] for panel in layout["configById"]}
    assert types == {"3D", "Plot", "RosOut"}  # unknown ones show an error


def test_every_panel_has_its_place(layout: dict[str, Any]) -> None:
    def panels(tree: Any) -> list[str]:
        if isinstance(tree, str):
            return [tree]
        assert tree["direction"] in {"row", "column"}
        assert 0 < tree["splitPercentage"] < 100
        return panels(tree["first"]) + panels(tree["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])


def test_of_a_hundred_robots_the_rows_of_the_first_are_plotted() -> None:
    config = json.loads(layout_of(load("hundred_tree")))["configById"]
    assert len(config["Plot!heading_errors"]["paths"]) == MOST_ROBOTS
    assert len(config["Plot!s_differences"]["paths"]) == 101
