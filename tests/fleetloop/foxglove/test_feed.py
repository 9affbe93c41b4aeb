"""Messages of a run that goes on are those of its record, however its rows come."""

import random
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from support.record_rows import packed

from configs.loading import load
from configs.resolve import signals_of
from fleetloop.foxglove.feed import MOST_WAITING_BYTES, Feed, Messages
from fleetloop.launch.drawn import drawing
from fleetloop.record.messages import unframed
from fleetloop.record.reader import Record
from fleetloop.record.schema import View

PERIOD_NS = 2_000_000
EVERYTHING = range(1, 100)
Content = dict[str, list[tuple[int, bytes]]]


@pytest.fixture(scope="module")
def record(finished_run: Path) -> Record:
    return Record.open(finished_run / "record.mcap")


@pytest.fixture
def feed() -> Feed:
    scenario = load("two_robots")
    tables = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    return Feed(tables, drawing(scenario), PERIOD_NS)


def tell(feed: Feed, record: Record, begin: int, end: int, without: tuple[str, ...] = ()) -> None:
    """The rows of these ticks, of each source in one block."""
    for robot in record.robots:
        for source, tables in (("plant", record.plant), ("controller", record.controller)):
            if f"{source}/{robot}" not in without:
                feed.hear(robot, source, begin, packed(tables[robot][begin:end]))


def content(feed: Feed, messages: Messages) -> Content:
    found: Content = defaultdict(list)
    for channel, block in messages:
        found[feed.layout.topic(channel)] += unframed(block)
    return {topic: said for topic, said in found.items() if said}


def of_file(path: Path) -> Content:
    """What a stock reader finds."""
    found: Content = defaultdict(list)
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            found[channel.topic].append((message.log_time, message.data))
    return found


def cut(rows: int, most: int, rng: random.Random) -> Iterator[tuple[int, int]]:
    begin = 0
    while begin < rows:
        end = min(begin + rng.randint(1, most), rows)
        yield begin, end
        begin = end


@pytest.mark.parametrize("seed", [1, 2])
def test_messages_are_those_of_the_record_however_rows_are_cut(
    finished_run: Path, record: Record, feed: Feed, seed: int
) -> None:
    rng = random.Random(seed)
    blocks = []
    for robot in record.robots:
        for source, tables in (("plant", record.plant), ("controller", record.controller)):
            rows, late = tables[robot], rng.randint(0, 200)  # sources are ahead of each other
            for begin, end in cut(len(rows), 128, rng):
                blocks.append((end + late, robot, source, begin, packed(rows[begin:end])))
    found: Content = defaultdict(list)
    for _, robot, source, begin, rows in sorted(blocks):
        feed.hear(robot, source, begin, rows)
        for topic, said in content(feed, feed.messages(EVERYTHING)).items():
            found[topic] += said
    found |= content(feed, feed.paths())
    expected = of_file(finished_run / "record.mcap")
    del expected["log"]  # events don't come with rows
    for topic in [it for it in expected if it.endswith(("plant", "controller"))]:
        expected[topic] = [one for one in expected[topic] if one[0] % 20_000_000 == 0]
    assert found == expected


def test_only_channels_that_are_wanted_have_messages(record: Record, feed: Feed) -> None:
    tell(feed, record, 0, 200)
    found = content(feed, feed.messages({View.TRANSFORMS}))
    assert {topic: len(said) for topic, said in found.items()} == {"tf": 8}


def test_a_source_that_is_silent_is_waited_for_only_for_a_while(record: Record, feed: Feed) -> None:
    tell(feed, record, 0, 100)
    assert content(feed, feed.messages(EVERYTHING))
    tell(feed, record, 100, 600, without=("controller/r2",))
    assert content(feed, feed.messages(EVERYTHING)) == {}
    tell(feed, record, 600, 700, without=("controller/r2",))
    found = content(feed, feed.messages(EVERYTHING))
    assert "robot/r2/controller" not in found
    assert [time_ns for time_ns, _ in found["robot/r1/plant"]] == [
        tick * PERIOD_NS for tick in range(100, 700, 10)
    ]


def test_one_that_comes_later_sees_the_newest_instants_and_what_follows(
    record: Record, feed: Feed
) -> None:
    tell(feed, record, 0, 900)
    feed.skip()
    tell(feed, record, 900, 1000)
    feed.skip()
    first = content(feed, feed.messages(EVERYTHING))
    assert [time_ns // PERIOD_NS for time_ns, _ in first["tf"]] == [950, 975]
    assert feed.time_ns == 999 * PERIOD_NS
    assert content(feed, feed.messages(EVERYTHING)) == {}
    # Another one, while the run stands still.
    again = content(feed, feed.newest({View.TRANSFORMS, View.ROBOTS}))
    assert again == {topic: first[topic] for topic in ("tf", "scene/robots")}
    tell(feed, record, 1000, 1100)
    following = content(feed, feed.messages(EVERYTHING))
    assert [time_ns // PERIOD_NS for time_ns, _ in following["tf"]] == [1000, 1025, 1050, 1075]


def test_a_viewer_in_the_middle_of_a_run_begins_with_the_rows_that_it_hears(
    record: Record, feed: Feed
) -> None:
    tell(feed, record, 1000, 1100, without=("controller/r2",))
    assert content(feed, feed.messages(EVERYTHING)) == {}
    feed.hear("r2", "controller", 1040, packed(record.controller["r2"][1040:1100]))
    found = content(feed, feed.messages(EVERYTHING))
    assert [time_ns // PERIOD_NS for time_ns, _ in found["tf"]] == [1050, 1075]
    assert next(time_ns // PERIOD_NS for time_ns, _ in found["robot/r1/plant"]) == 1040


def test_what_waits_is_bounded(record: Record, feed: Feed) -> None:
    block = packed(record.plant["r1"][:1000])
    times = MOST_WAITING_BYTES // len(block) + 5
    for number in range(times):
        feed.hear("r1", "plant", 1000 * number, block)
    (held,) = [it for it in feed._held.values() if it.blocks]
    assert len(held.blocks) == times - 5
    feed.skip()
    assert len(held.blocks) == 1
