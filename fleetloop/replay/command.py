"""`fleetloop replay`: one robot's recorded inputs into its controller, or into another one."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bridge.frame import Frame
from bridge.network.inputs import InputsError, Kind
from configs.errors import ExitStatus, ScenarioError
from configs.loading import loads
from configs.scenario import Scenario
from configs.signals import Signal
from fleetloop.record.inputs_file import InputLog, path_of, read_inputs
from fleetloop.record.reader import Record
from fleetloop.replay.changes import brief_of, changed_brief
from fleetloop.replay.player import Replay, play
from fleetloop.replay.repeat import repeated_inputs
from fleetloop.results import run_folder
from fleetloop.results.diff import print_divergences
from fleetloop.results.divergence import EXACT, Divergence, Pair, Tolerance, divergences
from fleetloop.terminal import note, say, say_json

FIGURES = (".png", ".svg", ".pdf")
_LABELS = "recorded", "replayed"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions:
    """Options of the command line for a replay."""

    robot: str
    sets: tuple[str, ...] = ()
    law: str | None = None
    tolerance: Tolerance = EXACT
    size_first: bool = False
    whole: bool = False
    out: Path | None = None
    signals: tuple[str, ...] = ()
    as_json: bool = False
    partial: bool = False


@dataclass(frozen=True, slots=True)
class Verdict:
    """A replay against its record."""

    replay: Replay
    recorded: np.ndarray
    """Rows of the record at the ticks of the replay's."""
    unreplayed: int
    """Rows of the record without inputs."""
    found: Sequence[Divergence]
    only: tuple[tuple[str, ...], tuple[str, ...]]
    """Signals of the record's law alone, and of the replay's."""

    @property
    def identical(self) -> bool:
        """Whether all that both have is the same."""
        replay = self.replay
        same = not (self.found or any(self.only) or replay.failure)
        return same and (replay.other_frames is None or not self.exact)

    exact: bool = True
    """Without a tolerance frames count, too."""


def replay_run(run: Path, options: ReplayOptions) -> int:
    """Replay a robot's controller, print where its outputs part; return the exit status.

    Raises:
        ScenarioError: no record or no inputs there, an unknown robot, law or signal, or a change
            that a replay can't show.
        IncompleteError: the record isn't all there, and `partial` wasn't asked for.
        InfrastructureError: the figure can't be written.
    """
    if options.out is not None and options.out.suffix not in FIGURES:
        raise ScenarioError(f"--out {options.out}: the ending must be {', '.join(FIGURES)}")
    record = run_folder.read_record(run, partial=options.partial)
    robot = options.robot
    if robot not in record.robots:
        raise ScenarioError(
            f"--robot {robot}: not in {record.path}; there are {', '.join(record.robots)}"
        )
    if not len(record.controller[robot]):
        raise ScenarioError(f"{record.path}: not one tick of {robot}'s controller is in it")
    scenario = loads(f"{record.path}: {run_folder.SCENARIO}", record.scenario_toml)
    changed = options.law is not None or bool(options.sets)
    brief = brief_of(scenario, robot)
    if changed:
        brief = changed_brief(scenario, robot, law=options.law, sets=options.sets)
    logs = _inputs(record, scenario, options)
    try:
        replay = play(brief, logs)
    except InputsError as error:
        raise ScenarioError(f"{path_of(record.path.parent, robot)}: {error}") from error
    verdict = _judge(record, replay, robot, brief.signals, options.tolerance)
    if options.as_json:
        say_json(_as_json(verdict, options))
    else:
        _print(verdict, options, changed=changed)
    if options.out is not None:
        _draw(verdict, options, options.out)
    return ExitStatus.OK if verdict.identical else ExitStatus.FAILED


def _inputs(record: Record, scenario: Scenario, options: ReplayOptions) -> Sequence[InputLog]:
    path = path_of(record.path.parent, options.robot)
    if path.is_file():
        logs = read_inputs(path)
        if not logs:
            raise ScenarioError(f"{path}: no inputs in it; the run ended before they were written")
        cut = [log for log in logs if not log.complete]
        if cut:
            note(f"{path}: {len(cut)} of its {len(logs)} logs end before their controller did")
        return logs
    if scenario.clock.mode == "realtime":
        raise ScenarioError(
            f"{record.path}: no inputs of {options.robot} were recorded ({path} isn't there), and a"
            " run in real time can't be repeated; run it without record.inputs = false"
        )
    return repeated_inputs(record, scenario, options.robot, quiet=options.as_json)


def _judge(
    record: Record, replay: Replay, robot: str, signals: Sequence[Signal], tolerance: Tolerance
) -> Verdict:
    of_record = record.controller[robot]
    of_record = of_record[_came(of_record)]
    both, there, here = np.intersect1d(
        of_record["tick"], replay.rows["tick"], assume_unique=True, return_indices=True
    )
    replay.rows = replay.rows[here]
    recorded = of_record[there]
    table = (*record.signals[robot], *signals)
    known = {signal.name for signal in table}
    if unknown := [name for name in tolerance.of_signal if name not in known]:
        raise ScenarioError(
            f"--tolerance {unknown[0]}: no such signal; there are {', '.join(sorted(known))}"
        )
    pair = Pair(robot, "controller", recorded, replay.rows)
    before, after = of_record.dtype.names or (), replay.rows.dtype.names or ()
    return Verdict(
        replay=replay,
        recorded=recorded,
        unreplayed=len(of_record) - len(both),
        found=divergences([pair], {"controller": table}, tolerance),
        only=(
            tuple(name for name in before if name not in after),
            tuple(name for name in after if name not in before),
        ),
        exact=not tolerance,
    )


def _came(rows: np.ndarray) -> np.ndarray:
    """Which rows are a controller's; of one that was killed some are only times."""
    names = [name for name in rows.dtype.names or () if name not in ("tick", "t_s")]
    came: np.ndarray = ~np.logical_and.reduce([np.isnan(rows[name]) for name in names])
    return came


def _print(verdict: Verdict, options: ReplayOptions, *, changed: bool) -> None:
    replay, robot = verdict.replay, options.robot
    messages = sum(replay.inputs[kind] for kind in (Kind.PATH, Kind.POSE, Kind.PLACE, Kind.LEADER))
    say(
        f"replayed {robot}: {replay.inputs[Kind.TICK]} periods from {replay.inputs[Kind.FRAME]}"
        f" frames and {messages} messages"
    )
    if changed:
        what = [f"--law {options.law}"] if options.law else []
        what += [f"--set {text}" for text in options.sets]
        say(f"open loop: {' '.join(what)} on inputs that were recorded without; they don't react")
    if replay.failure:
        say(f"ended early: {replay.failure}")
    if verdict.unreplayed:
        say(f"{verdict.unreplayed} recorded ticks have no inputs, and were left out")
    for names, where in zip(verdict.only, _LABELS, strict=True):
        if names:
            say(f"only {where}: {', '.join(names)}")
    ticks = len(replay.rows)
    if verdict.identical:
        kept = f"{len(replay.rows.dtype.names or ()) - 1} signals and {replay.frames} sent frames"
        if options.tolerance:
            say(f"within the tolerance: {ticks} ticks, every signal")
        else:
            say(f"identical: {ticks} ticks, {kept}, bit for bit")
        return
    if verdict.found:
        one = verdict.found[0]
        say(
            f"different from tick {one.first.tick} (t = {one.first.t_s:.3f} s) of {ticks} on:"
            f" {one.signal.name} {one.first.a!r} recorded, {one.first.b!r} replayed"
        )
    if (other := replay.other_frames) is not None:
        say(
            f"frames sent at {replay.other_ticks} ticks differ, first at tick {other.tick}:"
            f" {_words(other.recorded)} recorded, {_words(other.replayed)} replayed"
        )
    print_divergences(
        verdict.found,
        _LABELS,
        size_first=options.size_first,
        whole=options.whole,
        of_one=True,
    )


def _draw(verdict: Verdict, options: ReplayOptions, out: Path) -> None:
    from fleetloop.replay.figure import signals_of, write_figure

    rows = verdict.recorded, verdict.replay.rows
    write_figure(out, signals_of(options.signals, *rows, verdict.found), *rows, options.robot)
    if not options.as_json:
        say(f"figure   {out}")


def _words(frames: Sequence[Frame]) -> str:
    """Frames in cansend's syntax."""
    return " ".join(f"{it.can_id:03X}#{it.data.hex().upper()}" for it in frames) or "none"


def _as_json(verdict: Verdict, options: ReplayOptions) -> dict[str, object]:
    replay, other = verdict.replay, verdict.replay.other_frames
    return {
        "robot": options.robot,
        "identical": verdict.identical,
        "open_loop": options.law is not None or bool(options.sets),
        "ticks": len(replay.rows),
        "unreplayed_ticks": verdict.unreplayed,
        "inputs": {kind.name.lower(): count for kind, count in sorted(replay.inputs.items())},
        "sent_frames": replay.frames,
        "first_other_frames_at_tick": None if other is None else other.tick,
        "ticks_with_other_frames": replay.other_ticks,
        "only_recorded": list(verdict.only[0]),
        "only_replayed": list(verdict.only[1]),
        "failure": replay.failure,
        "signals": [one.as_dict() for one in verdict.found],
    }
