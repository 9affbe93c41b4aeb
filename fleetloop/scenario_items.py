"""Scenarios as tests of pytest: each file `*.fleetloop.toml` that pytest finds is an item.

    pytest bench/                                  # bench/push.fleetloop.toml, ...
    pytest bench/ --fleetloop-processes            # over processes, where it could be one

An item runs `fleetloop test` on its file; what it expects has to hold. A failure shows the
expectations that failed, each with its worst tick, robot and margin. Nothing of ours is imported
here: in the pytest of others our packages' names may be theirs.
"""

import json
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

SUFFIX = ".fleetloop.toml"
_GRACE_S = 60.0
"""For the program itself, beside the run."""
_BAD = ("failed", "error")


class ScenarioError(Exception):
    """A scenario did not hold; the text says what and where."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of the plug-in."""
    group = parser.getgroup("fleetloop")
    group.addoption(
        "--fleetloop-processes",
        action="store_true",
        help="Run *.fleetloop.toml over processes. Default: in one process where that can be.",
    )
    group.addoption(
        "--fleetloop-timeout",
        type=float,
        default=600.0,
        metavar="SECONDS",
        help="Longest time of one *.fleetloop.toml.",
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> "ScenarioFile | None":
    """Collect a scenario."""
    if file_path.name.endswith(SUFFIX):
        return ScenarioFile.from_parent(parent, path=file_path)
    return None


class ScenarioFile(pytest.File):
    """A scenario file."""

    def collect(self) -> Iterable["ScenarioItem"]:
        """Its one item, named after it."""
        yield ScenarioItem.from_parent(self, name=self.path.name.removesuffix(SUFFIX))


class ScenarioItem(pytest.Item):
    """A scenario that has to hold."""

    def runtest(self) -> None:
        """Run it.

        Raises:
            ScenarioError: something that it expects did not hold, or it could not be run.
        """
        within_s = float(self.config.getoption("--fleetloop-timeout"))
        # -P: a folder of the tests that is named like one of our packages must not shadow it.
        command = [sys.executable, "-P", "-m", "fleetloop", "test", str(self.path), "--json"]
        command += ["--jobs", "1", "--timeout", f"{within_s:g}"]
        if self.config.getoption("--fleetloop-processes"):
            command.append("--processes")
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=within_s + _GRACE_S, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise ScenarioError(f"{self.path}: no outcome after {error.timeout:g} s") from None
        self._judge(done)

    def _judge(self, done: "subprocess.CompletedProcess[str]") -> None:
        """Pass, skip or fail by what the program said."""
        try:
            said: dict[str, Any] = json.loads(done.stdout)
            (account,) = said["accounts"].values()
            (status,) = said["counts"]
        except (ValueError, KeyError, TypeError):
            raise ScenarioError(done.stderr.strip() or done.stdout.strip()) from None
        if status in _BAD:
            raise ScenarioError("\n".join(account))
        if status == "skipped":
            pytest.skip("the scenario expects nothing")

    def repr_failure(self, excinfo: Any, style: Any = None) -> Any:
        """What failed, without a traceback of ours."""
        if isinstance(excinfo.value, ScenarioError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where it is."""
        return self.path, None, f"scenario {self.name}"
