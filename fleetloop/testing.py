"""Fixtures for tests of your own: runs of scenarios, and emulated robots for CAN host code.

    def test_the_fleet_stays_together(fleetloop_run):
        run = fleetloop_run("two_robots")           # fails the test if it doesn't hold
        assert run.signal("s_spread").max() < 0.01

    def test_my_host(fleetloop_plant):
        plant = fleetloop_plant("two_robots", robots=["r1"])
        with can.Bus(**plant.buses["r1"]) as bus:
            ...

pytest finds the fixtures where Fleetloop is installed. `fleetloop_plant` starts `fleetloop plant`,
a process of its own in real time: two emulated drives per robot on a bus, and the body that they
move. With the test it is gone, its sockets too; if the test's own process is killed, it ends by
itself.
"""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, NamedTuple, Self

import pytest

if TYPE_CHECKING:
    from configs.scenario import Scenario
    from fleetloop.api.result import Run

READY_S = 20.0
ANSWER_S = 5.0
END_S = 5.0


class PlantError(RuntimeError):
    """The plant did not start, did not answer or has ended; the text is its output."""


class RobotState(NamedTuple):
    """Where a robot is, how it moves, and what its motors do."""

    x_m: float
    y_m: float
    theta_rad: float
    v_m_s: float
    omega_rad_s: float
    torque_right_wheel_N_m: float
    torque_left_wheel_N_m: float


class EmulatedPlant:
    """`fleetloop plant` as a process of its own; a context manager that ends it.

    Args:
        scenario: a scenario file, or the name of a shipped one.
        robots: only these of its robots.
        overrides: as `--set`, for example "drive.watchdog_s=0.0".
        deployment: file that puts robots on other python-can interfaces.

    Raises:
        PlantError: it did not start.
    """

    buses: dict[str, dict[str, Any]]
    """Arguments of `can.Bus(**...)`, by robot."""

    def __init__(
        self,
        scenario: str | Path = "two_robots",
        *,
        robots: Iterable[str] = (),
        overrides: Iterable[str] = (),
        deployment: Path | None = None,
    ) -> None:
        options = [option for override in overrides for option in ("--set", override)]
        if names := ",".join(robots):
            options += ["--robots", names]
        if deployment is not None:
            options += ["--deployment", str(deployment)]
        # -P: a folder of the tests that is named like one of our packages must not shadow it.
        command = [sys.executable, "-P", "-m", "fleetloop", "plant", str(scenario)]
        self._process = subprocess.Popen(
            [*command, "--json", "--stdin", *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        self._unread = b""
        try:
            self.buses = self._answer(READY_S)["buses"]
        except BaseException:
            self.stop()
            raise

    def poses(self) -> dict[str, RobotState]:
        """Where all robots are now.

        Raises:
            PlantError: the plant has ended or doesn't answer.
        """
        robots = self._ask("poses")["robots"]
        return {robot: RobotState(**state) for robot, state in robots.items()}

    def time_s(self) -> float:
        """Bus time: seconds since the drives were powered up.

        Raises:
            PlantError: the plant has ended or doesn't answer.
        """
        return float(self._ask("poses")["t_s"])

    def inject(self, kind: str, **keys: Any) -> str:
        """Apply a fault, with the keys of [[fault]]: `robots=["r1"], for_s=2.0, wheel="left"`.

        Without `at_s` it acts at once, without `robots` on all of this plant. Returns its name.

        Raises:
            PlantError: it can't act, or the plant has ended; the text says why.
        """
        return str(self._ask(f"inject {json.dumps({'kind': kind, **keys})}")["fault"]["name"])

    def clear(self, name: str) -> None:
        """End a fault that was injected.

        Raises:
            PlantError: there is none of this name, or the plant has ended.
        """
        self._ask(f"clear {name}")

    def stop(self) -> str:
        """End the plant; return its standard error. Idempotent."""
        stdin, stdout, stderr = self._pipes()
        stdin.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        said = "" if stderr.closed else stderr.read().decode("utf-8", "replace")
        stdout.close()
        stderr.close()
        return said

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()

    def _pipes(self) -> tuple[IO[bytes], IO[bytes], IO[bytes]]:
        process = self._process
        if process.stdin is None or process.stdout is None or process.stderr is None:
            raise PlantError("its pipes are gone")
        return process.stdin, process.stdout, process.stderr

    def _ask(self, request: str) -> dict[str, Any]:
        stdin, _, _ = self._pipes()
        try:
            stdin.write(request.encode() + b"\n")
            stdin.flush()
        except (OSError, ValueError) as error:
            raise PlantError(f"the plant has ended: {self.stop().strip() or error}") from error
        answer = self._answer(ANSWER_S)
        if "error" in answer:
            raise PlantError(answer["error"])
        return answer

    def _answer(self, within_s: float) -> dict[str, Any]:
        """Its next line, waiting at most so long."""
        _, stdout, _ = self._pipes()
        deadline = time.monotonic() + within_s
        while b"\n" not in self._unread:
            left_s = deadline - time.monotonic()
            if left_s <= 0.0 or not _readable(stdout, left_s):
                raise PlantError(f"the plant said nothing for {within_s:g} s")
            more = os.read(stdout.fileno(), 65536)
            if not more:
                raise PlantError(self.stop().strip() or "the plant ended without a word")
            self._unread += more
        line, _, self._unread = self._unread.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer


def _readable(stream: IO[bytes], within_s: float) -> bool:
    poller = select.poll()
    poller.register(stream, select.POLLIN)
    return bool(poller.poll(within_s * 1e3))


@pytest.fixture
def fleetloop_plant() -> Iterator[Callable[..., EmulatedPlant]]:
    """Start emulated robots, with the arguments of `EmulatedPlant`; they end with the test."""
    with ExitStack() as plants:

        def start(scenario: str | Path = "two_robots", **options: Any) -> EmulatedPlant:
            return plants.enter_context(EmulatedPlant(scenario, **options))

        yield start


@pytest.fixture
def fleetloop_run(tmp_path: Path) -> "Callable[..., Run]":
    """Run scenarios; one that doesn't hold fails the test, in the words of its verdict.

        fleetloop_run(scenario, *, must_hold=True, allow_unchecked=False, **options)

    The scenario is one of `fleetloop.load`, a file, or the name of a shipped one; the options are
    those of `fleetloop.run`, as `in_process=False`. Folders of runs are in `tmp_path`.
    """

    def run(
        scenario: "Scenario | str | Path",
        *,
        must_hold: bool = True,
        allow_unchecked: bool = False,
        **options: Any,
    ) -> "Run":
        __tracebackhide__ = True
        import fleetloop

        number = sum(1 for _ in tmp_path.glob("run-*")) + 1
        try:
            made = fleetloop.run(scenario, **({"out": tmp_path / f"run-{number}"} | options))
            return made.raise_for_verdict(allow_unchecked=allow_unchecked) if must_hold else made
        except fleetloop.NotHeldError as error:
            words = f"{error}\n{made.folder}"
        except fleetloop.FleetloopError as error:
            words = str(error)
        pytest.fail(words)

    return run
