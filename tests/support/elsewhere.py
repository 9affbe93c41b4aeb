"""Roles that a test starts itself, as on another machine, beside a run that excludes them."""

import secrets
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from support.addresses import free_port
from support.processes import Run

SCENARIO = ("two_robots_100hz", "--set", "expect=[]")
SHORT = ("--duration", "1")


class Agent:
    """A `fleetloop agent` that is going on."""

    def __init__(
        self,
        robot: str,
        deployment: Path,
        *args: str,
        scenario: Sequence[str] = SCENARIO,
        ahead_s: float = 0.0,
    ) -> None:
        program = ("-m", "fleetloop")
        if ahead_s:
            program = (str(Path(__file__).with_name("shifted_agent.py")), str(ahead_s))
        self.process = subprocess.Popen(
            [
                *(sys.executable, *program, "agent", scenario[0], robot, *scenario[1:]),
                *("--deployment", str(deployment), *args),
            ],
            stderr=subprocess.PIPE,
            text=True,
        )

    def end(self, within_s: float = 120.0) -> tuple[int, str]:
        """(exit status, what it said)."""
        _, said = self.process.communicate(timeout=within_s)
        return self.process.returncode, said

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


def deployment(folder: Path, scheme: str = "tcp", extra: str = "", name: str = "where") -> Path:
    """r2's controller is elsewhere."""
    file = folder / f"{name}.toml"
    file.write_text(
        'roles = ["plant", "recorder", "agent/r1"]\n[network]\n'
        f'endpoint = "{scheme}/localhost:{free_port()}"\n{extra}'
    )
    return file


def with_password(folder: Path) -> Path:
    users = folder / "users"
    users.write_text(f"agent-r2:{secrets.token_hex(8)}\n")
    users.chmod(0o600)
    return deployment(folder, extra='users = "users"\n')


def start(folder: Path, where: Path, *args: str) -> Run:
    return Run(folder / "run", *SCENARIO, "--deployment", str(where), *args)
