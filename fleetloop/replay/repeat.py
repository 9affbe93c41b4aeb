"""The inputs of a controller in lockstep whose run didn't record them: the run once more.

A lockstep run in one process leaves the same record, so it gives the same inputs. Whether it does,
its rows tell: they are compared with the record's as they come, and the first other bit ends it.
An interrupted run is repeated as far as its record goes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.errors import FleetloopError, ScenarioError
from configs.resolve import leader_brief, plant_brief
from configs.scenario import Scenario
from fleetloop.in_process.run import InProcessRun
from fleetloop.record.inputs_file import InputLog
from fleetloop.record.reader import Record
from fleetloop.record.writer import Source
from fleetloop.replay.changes import NOWHERE, brief_of
from fleetloop.signals import stop_on_signals
from fleetloop.terminal import RunProgress, note


class _Witness:
    """Keeps one robot's input log, and compares all rows with those of the record."""

    def __init__(self, record: Record, stop: Stop) -> None:
        self._rows = {
            (robot, source): _bits(rows)
            for source, of_robots in (("plant", record.plant), ("controller", record.controller))
            for robot, rows in of_robots.items()
        }
        self._stop = stop
        self.ticks = max(map(len, self._rows.values()))
        """Of the record, which ends before its scenario does if the run was interrupted."""
        self.blocks: list[bytes] = []
        self.other = ""
        """Where the run came to differ."""

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        recorded = self._rows[robot, source]
        came = np.frombuffer(rows, "<u8").reshape(-1, recorded.shape[1])
        there = recorded[first_tick : first_tick + len(came)]
        differ = (came[: len(there)] != there).any(axis=1)
        if differ.any() and not self.other:
            self.other = f"{robot}, {source}, tick {first_tick + int(differ.argmax())}"
            self._stop.request("it is another run")

    def end(self, robot: str, source: Source) -> None:
        pass

    def traffic(self, bus: str, frames: bytes) -> None:
        pass

    def inputs(self, robot: str, first: int, block: bytes, final: bool) -> None:  # noqa: ARG002
        self.blocks.append(block)


def _bits(rows: np.ndarray) -> np.ndarray:
    columns = len(rows.dtype.names or ())
    return np.ascontiguousarray(rows).view("<u8").reshape(len(rows), columns)[:, 1:]


def repeated_inputs(
    record: Record, scenario: Scenario, robot: str, *, quiet: bool
) -> Sequence[InputLog]:
    """Run a recorded scenario again in this process; the input log of one robot's controller.

    Raises:
        ScenarioError: the run doesn't come out as the record has it, or the repetition was
            interrupted.
    """
    note(f"{record.path}: has no inputs; a lockstep run can be repeated to have them")
    briefs = [
        replace(brief_of(scenario, name), logs_inputs=name == robot) for name in scenario.names
    ]
    failure = ""
    with stop_on_signals() as stop:
        witness = _Witness(record, stop)
        ends_at_s = min(witness.ticks * scenario.clock.control_period_s, scenario.ends_at_s)

        with RunProgress(f"{scenario.name} again", ends_at_s, quiet=quiet) as progress:

            def show(state: Progress) -> None:
                progress.show(state.t_ns * 1e-9, state.wall_ns * 1e-9)

            try:
                plant = plant_brief(scenario, network=NOWHERE)
                run = InProcessRun(plant, briefs, leader_brief(scenario), witness, show)
                run.run(stop, witness.ticks)
            except FleetloopError as error:
                failure = str(error)
    why = f"it differs from {witness.other} on" if witness.other else failure
    if not why and stop.requested:
        why = stop.reason
    if why:
        raise ScenarioError(
            f"{record.path}: has no inputs of {robot}, and its run can't be repeated: {why}; code"
            " or machine are others, or something from outside took part; run with --record-inputs"
        )
    return [InputLog(b"".join(witness.blocks), True)]
