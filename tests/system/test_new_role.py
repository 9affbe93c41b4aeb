"""The README's walk for a new role: its module, its row, its brief, the line that fills it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODULE = '''
"""A role that counts the rows of all robots."""

from pathlib import Path

from bridge.network import keys
from bridge.network.client import open_client
from bridge.process.lifecycle import Stop, serve
from configs.brief import CounterBrief
from configs.roles import COUNTER


def run(brief: CounterBrief, stop: Stop) -> str:
    blocks = 0
    with open_client(brief.network, 10.0, stop) as link:
        for robot in brief.robots:
            link.subscribe(keys.telemetry(brief.network.run, robot), robot)
        link.declare_live(keys.live(brief.network.run, COUNTER.name))
        while not stop.requested:
            blocks += link.receive(0.1) is not None
    Path(brief.path).write_text(str(blocks))
    return "counted"


def main() -> int:
    return serve(CounterBrief, run, name=COUNTER.name)
'''
ROW = """COUNTER = Role(
    name="counter",
    module="fleetloop.counter",
    brief=CounterBrief,
    beside_launcher=True,
    observer=True,
    hears=(Topic.TELEMETRIES,),
)
"""
BRIEF = '''

@dataclass(frozen=True, slots=True, kw_only=True)
class CounterBrief:
    """What the counter is told."""

    robots: tuple[str, ...]
    path: str
    network: NetworkLink
'''
FILLED = """
    "counter": lambda place: CounterBrief(
        robots=place.orders.scenario.names,
        path=str(place.orders.record.with_name("count")),
        network=place.network,
    ),
"""


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert text.count(old) == 1, (path, old)
    path.write_text(text.replace(old, new), "utf-8")


def test_a_role_that_observes_a_run_is_its_module_a_row_a_brief_and_a_line(tmp_path) -> None:
    home = tmp_path / "home"
    for package in ("agents", "bridge", "configs", "fleetloop", "plant"):
        shutil.copytree(ROOT / package, home / package, ignore=shutil.ignore_patterns("*.pyc"))
    (home / "fleetloop" / "counter.py").write_text(MODULE)
    with (home / "configs" / "brief.py").open("a") as brief:
        brief.write(BRIEF)
    roles = home / "configs" / "roles.py"
    edit(roles, "import AgentBrief,", "import AgentBrief, CounterBrief,")
    edit(roles, "LOCALISATION = Role(", f"{ROW}LOCALISATION = Role(")
    edit(roles, "ROLES = (PLANT, AGENT, RECORDER,", "ROLES = (PLANT, AGENT, RECORDER, COUNTER,")
    spawn = home / "fleetloop" / "launch" / "spawn.py"
    edit(spawn, "    RECORDER.name: _recorder,\n", f"    RECORDER.name: _recorder,{FILLED}")
    edit(
        spawn,
        "from configs.roles import",
        "from configs.brief import CounterBrief\nfrom configs.roles import",
    )
    run = tmp_path / "run"
    command = ("run", "two_robots", "--duration", "1", "--allow-unchecked", "--no-report")
    done = subprocess.run(
        [sys.executable, "-m", "fleetloop", *command, "--out", str(run)],
        cwd=home,
        env=os.environ | {"PYTHONPATH": str(home)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert int((run / "count").read_text()) > 0
    assert (run / "record.mcap").exists()
