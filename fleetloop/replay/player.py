"""A controller fed with the input logs of a run. Pure: logs in, rows and frames out.

log       of one controller process; a robot's controller that was started again has several
rows      as the run recorded them: of the ticks that the logs have inputs of
frames    sent at each tick, against those in the log
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from agents.agent import Agent
from agents.inputs import feed
from bridge.frame import Frame
from bridge.network.inputs import Input, InputsError, Kind, entries
from bridge.network.telemetry import RowBuffer, row_of
from configs.brief import AgentBrief
from configs.errors import FleetloopError
from fleetloop.record.inputs_file import InputLog
from fleetloop.record.schema import row_type


class OtherFrames(NamedTuple):
    """Frames of a tick that a replay sent instead of those in the log."""

    tick: int
    recorded: Sequence[Frame]
    replayed: Sequence[Frame]


@dataclass(slots=True)
class Replay:
    """What came of a replay."""

    rows: np.ndarray
    """The tick, then the signals by name; ticks without inputs are not there."""
    inputs: Counter[Kind] = field(default_factory=Counter)
    frames: int = 0
    """Frames in the log that were to be sent."""
    other_frames: OtherFrames | None = None
    """The first that differ."""
    other_ticks: int = 0
    """Ticks whose frames differ."""
    failure: str = ""
    """Why the controller ended before its inputs."""


def play(brief: AgentBrief, logs: Sequence[InputLog]) -> Replay:
    """Feed the logs of a robot's controllers, one after the other.

    Raises:
        InputsError: a log is none of this version.
    """
    blocks: list[tuple[int, bytes]] = []
    replay = Replay(np.empty(0, row_type(brief.signals)))
    for log in logs:
        rows = RowBuffer(
            row_of(brief.signals), lambda first, _, block, __: blocks.append((first, block))
        )
        inputs = entries(log.entries)
        begin = next(inputs, None)
        if begin is None or begin.kind is not Kind.BEGIN:
            raise InputsError("the log doesn't begin with the begin of a controller")
        rejoins, resumes_tick = begin.begin()
        agent = Agent(replace(brief, rejoins=rejoins, resumes_tick=resumes_tick), rows)
        try:
            for entry in inputs:
                _give(agent, entry, replay)
        except FleetloopError as error:
            replay.failure = str(error)
        rows.finish()
    replay.rows = _table(brief, blocks)
    return replay


def _give(agent: Agent, entry: Input, replay: Replay) -> None:
    kind = entry.kind
    replay.inputs[kind] += 1
    if kind is Kind.PATH and not _hears(agent.brief, entry.named()[0]):
        return
    sent = feed(agent, entry)
    if kind is not Kind.TICK and kind is not Kind.STOP:
        return
    recorded = entry.sent()
    replay.frames += len(recorded)
    if list(sent) != recorded:
        replay.other_ticks += 1
        if replay.other_frames is None:
            tick = entry.tick() if kind is Kind.TICK else agent.admission.tick + 1
            replay.other_frames = OtherFrames(tick, recorded, list(sent))


def _hears(brief: AgentBrief, robot: str) -> bool:
    return any(edge.speaker == robot for edge in brief.hears)


def _table(brief: AgentBrief, blocks: Sequence[tuple[int, bytes]]) -> np.ndarray:
    """The rows of all blocks in the order of ticks; of a tick that comes twice the later one."""
    width = len(brief.signals)
    values = {
        first + n: row
        for first, block in blocks
        for n, row in enumerate(np.frombuffer(block, "<f8").reshape(-1, width))
    }
    rows = np.zeros(len(values), row_type(brief.signals))
    rows["tick"] = ticks = np.array(sorted(values), np.int64)
    matrix = np.array([values[tick] for tick in ticks.tolist()]).reshape(-1, width)
    for column, signal in enumerate(brief.signals):
        rows[signal.name] = matrix[:, column]
    return rows
