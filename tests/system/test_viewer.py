"""The viewer's process: started when a run is asked for it, and nothing to the run."""

import signal
from pathlib import Path

import psutil
import pytest
from support.processes import Run, running

from fleetloop.door.client import RefusedError, open_run
from fleetloop.launch.viewer import NICE

pytestmark = pytest.mark.system

PACED = ("two_robots", "--set", "expect=[]", "--duration", "100", "--speed", "1")


def viewers(run: Run) -> list[psutil.Process]:
    children = run.launcher.children(recursive=True)
    return [child for child in children if child.cmdline()[:1] == ["fleetloop viewer"]]


def test_it_is_started_once_its_end_is_noticed_and_the_runs_end_ends_it(tmp_path: Path) -> None:
    with running(tmp_path / "run", *PACED, bus_time_s=0.3) as run, open_run("") as client:
        url = client.ask("live.open")["url"]
        assert client.ask("live.open")["url"] == url
        with pytest.raises(RefusedError, match="not this run's viewer"):
            client.ask("live.listening", token="guess", url="http://elsewhere")
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
