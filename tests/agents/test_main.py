"""A controller's process: however its loop ends, the wheels are stopped before anything else."""

from types import SimpleNamespace

import can
import pytest
from support.robot_bench import ZERO, Bench, commands, set_points

from agents.__main__ import _Connections
from agents.guard import Phase
from agents.lockstep import LockstepCounters
from agents.process_faults import ProcessFaults
from bridge.can_bus.pythoncan import to_frame
from bridge.drives.odrive.frames import Command
from bridge.network.barrier import Hellos
from bridge.process.lifecycle import Stop
from configs.errors import InfrastructureError, PeerSilentError


class Ending:
    """A controller that drives, and what it then sends and says, in order."""

    def __init__(self, *overrides: str, bus_fails: bool = False) -> None:
        self.bench = Bench("r2", *overrides)
        self.bench.drive(5)
        self.bus_fails = bus_fails
        self.frames: list = []
        self.said: list[str] = []
        bus = SimpleNamespace(send=self._send, recv=lambda _: None)
        publisher = SimpleNamespace(put=lambda _: self.said.append("report"))
        self.connections = _Connections(
            agent=self.bench.agent,
            bus=bus,
            link=None,
            subscriptions=None,
            path=publisher,
            hellos=Hellos(0.02),
            rows=self.bench.agent.rows,
            report=publisher,
            progress=SimpleNamespace(put=lambda _: None),
        )
        self.stop = Stop()
        self.stop.release()

    def _send(self, message: can.Message) -> None:
        if self.bus_fails and not self.frames:
            self.bus_fails = False
            raise can.CanOperationError("no buffer space")
        assert self.said == []
        self.frames.append(to_frame(message))
        self.bench.answer([self.frames[-1]])

    def end(self, error: BaseException) -> None:
        def body() -> None:
            raise error

        with pytest.raises(type(error)):
            guard = self.bench.agent.guard
            faults = ProcessFaults(self.bench.agent.brief, guard.note)
            loop = SimpleNamespace(counters=LockstepCounters(), faults=faults)
            self.connections.run(body, self.stop, loop)


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("a bug"),
        InfrastructureError("the network is gone"),
        PeerSilentError("no pose"),
        KeyboardInterrupt(),
        SystemExit(1),
        MemoryError(),
    ],
    ids=lambda error: type(error).__name__,
)
def test_whatever_is_raised_leaves_both_drives_disarmed_and_then_reports(error) -> None:
    ending = Ending()
    ending.end(error)
    assert set_points(ending.frames) == [ZERO, ZERO]
    assert commands(ending.frames).count(Command.SET_AXIS_STATE) == 2
    assert ending.bench.closed() == [False, False]
    assert ending.bench.phase is Phase.DONE
    assert ending.said == ["report"]


def test_the_end_is_an_estop_if_the_scenario_wants_that() -> None:
    ending = Ending("host.on_exit='estop'")
    ending.end(RuntimeError("a bug"))
    assert commands(ending.frames)[-2:] == [Command.ESTOP, Command.ESTOP]


def test_a_frame_that_cannot_be_sent_does_not_keep_the_others_back() -> None:
    ending = Ending(bus_fails=True)
    ending.end(RuntimeError("a bug"))
    assert len(ending.frames) == 3
    assert ending.bench.closed() == [False, False]
