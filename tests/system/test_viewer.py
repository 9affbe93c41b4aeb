"""The viewer's process: started when a run is asked for it, and nothing to the run."""

import asyncio
import signal
from pathlib import Path
from typing import Any

import psutil
import pytest
from support.foxglove_client import FoxgloveClient
from support.processes import Run, running

from fleetloop.door.client import RefusedError, open_run
from fleetloop.launch.viewer import NICE

pytestmark = pytest.mark.system

PACED = ("two_robots", "--set", "expect=[]", "--duration", "100", "--speed", "1")


def viewers(run: Run) -> list[psutil.Process]:
    children = run.launcher.children(recursive=True)
    return [child for child in children if child.cmdline()[:1] == ["fleetloop viewer"]]


async def heard_at(address: str) -> dict[str, Any]:
    """The first messages of two channels at a Foxglove WebSocket."""
    client = await FoxgloveClient.open(address)
    found: dict[str, Any] = {}
    for topic in ("log", "fleet"):
        await client.subscribe(topic)
    while len(found) < 2:
        (said,) = await client.take(1)
        found.setdefault(said.topic, said.content)
    await client.close()
    return found


def test_it_is_started_once_its_end_is_noticed_and_the_runs_end_ends_it(tmp_path: Path) -> None:
    with running(tmp_path / "run", *PACED, bus_time_s=0.3) as run, open_run("") as client:
        url = client.ask("live.open")["url"]
        assert client.ask("live.open")["url"] == url
        with pytest.raises(RefusedError, match="not this run's viewer"):
            client.ask("live.listening", token="guess", view="page", url="http://elsewhere")
        with pytest.raises(RefusedError, match="view 'globe': must be one of page, foxglove"):
            client.ask("live.open", view="globe")
        stream = client.ask("live.open", view="foxglove")["url"]
        assert client.ask("live.open", view="foxglove")["url"] == stream
        said = asyncio.run(heard_at(stream))
        assert said["fleet"].s_spread < 0.1
        assert said["log"].message == "armed"
        (first,) = viewers(run)
        assert first.nice() == NICE
        first.kill()
        run.await_line("live: the viewer has ended: killed by SIGKILL; .*", 10.0)
        client.ask("live.open")
        (second,) = viewers(run)
        second.suspend()  # it reads nothing any more, and doesn't obey
        run.launcher.send_signal(signal.SIGINT)
        status, out = run.end()
    assert status == 130, out
    assert not second.is_running()
    assert run.summary()["verdict"] == "interrupted"
