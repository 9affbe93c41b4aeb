"""The viewer's process: hears rows, progress and notices of a run, and asks its launcher.

Started by the launcher when the run's door is asked for it (`fleetloop.launch.viewer`). It yields
the processor to everything else (nice 19), and its end is nothing to the run.
"""

import os
from collections import Counter
from pathlib import Path

from bridge.network import keys
from bridge.network.client import StoppedError, open_client
from bridge.network.link import Arrival, Link
from bridge.network.messages import Rows
from bridge.network.telemetry import PLANT_ROW, row_of
from bridge.process.lifecycle import Stop, serve
from configs.brief import ViewerBrief
from configs.loading import loads
from configs.resolve import signals_of
from configs.roles import VIEWER, processes_of
from configs.scenario import Scenario
from fleetloop.door.client import RunClient
from fleetloop.results import run_folder

NICE = 19
ROOM_BYTES = 1 << 22
"""Of what waits of one source: a viewer that falls behind misses rows."""
LOOK_S = 0.1


class Heard:
    """Counts the rows of each source, and other messages by their kind.

    Args:
        scenario: of the run.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.counts: Counter[str] = Counter()
        """Rows by truth/<robot> and telemetry/<robot>; messages by progress and notice."""
        self._row_bytes = {
            f"telemetry/{robot.name}": row_of(signals_of(scenario, robot)).size
            for robot in scenario.robot
        } | {f"truth/{robot.name}": PLANT_ROW.size for robot in scenario.robot}

    def subscribe(self, link: Link, run: str) -> None:
        """Subscribe to what the viewer may hear."""
        robots = tuple(tag.partition("/")[2] for tag in self._row_bytes if tag.startswith("truth/"))
        for robot in robots:
            link.subscribe(keys.truth(run, robot), f"truth/{robot}", room_bytes=ROOM_BYTES)
            link.subscribe(keys.telemetry(run, robot), f"telemetry/{robot}", room_bytes=ROOM_BYTES)
        for process in processes_of(robots):
            link.subscribe(keys.progress(run, process), "progress")
            link.subscribe(keys.notice(run, process), "notice")

    def take(self, arrival: Arrival) -> None:
        """Count a message."""
        row_bytes = self._row_bytes.get(arrival.tag)
        if row_bytes is None:
            self.counts[arrival.tag] += 1
        elif (rows := Rows.decode(arrival.payload, row_bytes)) is not None:
            self.counts[arrival.tag] += rows.length


def run(brief: ViewerBrief, stop: Stop) -> str:
    """Hear and count until told to stop."""
    os.nice(NICE)
    heard = Heard(loads(run_folder.SCENARIO, brief.scenario_toml, recorded=True))
    try:
        link = open_client(brief.network, brief.start_deadline_s, stop)
    except StoppedError:
        return ""
    with link, RunClient(Path(brief.door)) as client:
        heard.subscribe(link, brief.network.run)
        link.declare_live(keys.live(brief.network.run, VIEWER.name))
        client.ask("live.listening", token=brief.token, url="")
        while not stop.requested:
            if (arrival := link.receive(LOOK_S)) is not None:
                heard.take(arrival)
    return f"heard {heard.counts.total()} rows and messages"


def main() -> int:
    """Serve as the viewer; return the exit status."""
    return serve(ViewerBrief, run, name=VIEWER.name)


if __name__ == "__main__":
    raise SystemExit(main())
