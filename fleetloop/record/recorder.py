"""The recorder's process: receives every robot's rows and writes `record.mcap`.

It stands apart from the lockstep path, so that neither writing nor a slow disk costs a tick, and it
outlives the launcher for as long as it takes to complete the file. Started by `fleetloop run`.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from math import nan
from pathlib import Path

from bridge.can_bus import sockets
from bridge.frame import MAX_DATA
from bridge.network import keys
from bridge.network.barrier import Hellos, await_hellos
from bridge.network.client import open_client
from bridge.network.link import Arrival, Dropped
from bridge.network.messages import PROGRESS_EVERY_S, Progress, Rows
from bridge.network.refused_messages import Refusals
from bridge.network.reports import Report
from bridge.network.telemetry import BLOCK_FRAMES, BLOCK_TICKS, FRAME_ROW, PLANT_ROW, row_of
from bridge.process.clock import SYSTEM_CLOCK, process_cpu_ns
from bridge.process.lifecycle import Stop, serve
from configs.brief import RecorderBrief
from configs.roles import RECORDER
from fleetloop.record.can_log import frames_of
from fleetloop.record.ears import open_ears
from fleetloop.record.run_record import RunRecord
from fleetloop.record.writer import Source

QUIET_S = 0.3
"""Once asked to stop, the recorder takes what still comes until nothing new came for this long."""
AHEAD_TICKS = 1 << 17
"""Largest lead of a source's rows over the slowest's; they wait in memory."""
GAPS = 8
"""Consecutive blocks after a gap from which on the missing rows count as lost."""
ABSENT_BYTES = 1 << 26
"""Rows of all others that wait for those of a controller that has left and may come again, if
that is `ABSENT_TICKS` or more of them: from then on its own count as lost."""
ABSENT_TICKS = 1 << 12
_TIME = struct.Struct("<d")
"""t_s, the first signal of every row."""
_WHOSE = {
    "plant": "the plant for {}",
    "controller": "{}'s controller",
    "can": "bus {}",
    "inputs": "the inputs of {}'s controller",
}


class _Recorder:
    def __init__(self, brief: RecorderBrief, record: RunRecord) -> None:
        self._record = record
        self._ticks = brief.ticks
        self._last_frame_ns = brief.last_frame_ns
        self._fills_gaps = brief.fills_gaps
        self._period_s = brief.period_ns * 1e-9
        self._filled: Counter[str] = Counter()  # rows that did not come, by source
        self.refusals = Refusals()
        self._gaps: Counter[str] = Counter()  # blocks in a row that leave one, by source
        sources = {f"{kind}/{r}" for r in brief.robots for kind in ("plant", "controller")}
        sources |= {f"can/{bus}" for bus in brief.buses}
        inputs = {f"inputs/{robot}" for robot in brief.robots if brief.logged_inputs}
        sizes = zip(brief.robots, (row_of(one).size for one in brief.controllers), strict=True)
        self._row_sizes = {f"controller/{robot}": size for robot, size in sizes}
        self._row_sizes |= {f"plant/{robot}": PLANT_ROW.size for robot in brief.robots}
        self._row_sizes |= {f"can/{bus}": FRAME_ROW.size for bus in brief.buses}
        self._row_sizes |= dict.fromkeys(inputs, 1)
        self._away: set[str] = set()  # controllers that have left and may come again
        self._absent: set[str] = set()  # those that have been away
        tick_bytes = sum(size for tag, size in self._row_sizes.items() if tag in sources)
        self._patience_ticks = min(max(ABSENT_BYTES // tick_bytes, ABSENT_TICKS), AHEAD_TICKS // 2)
        self._lost_inputs: dict[str, int] = {}  # by tag, the byte from which on they are missing
        self.unheard = set(sources)
        self._tags = frozenset(sources | inputs)
        self.unfinished = set(self._tags)
        self.ticks = 0

    def process(self, arrival: Arrival) -> bool:
        """Store what may be stored; return whether the record has more now."""
        kind, _, robot = arrival.tag.partition("/")
        rows = Rows.decode(arrival.payload, self._row_sizes[arrival.tag])
        if rows is not None and kind == "inputs":
            return self._store_inputs(arrival.tag, robot, rows)
        if rows is not None and kind == "controller" and self._leaves(arrival.tag, rows):
            return rows.final
        if rows is not None and arrival.tag in self._absent:
            rows = self._of_returned(arrival.tag, rows)
        if rows is not None and kind != "can" and (self._fills_gaps or arrival.tag in self._absent):
            self._fill_gap(arrival.tag, rows)
        wrong = "not well formed" if rows is None else self._wrong(kind, robot, rows)
        if rows is None or wrong is not None:
            self._refuse(arrival.tag, wrong or "")
            if rows is not None:
                self._give_up_if_gone(arrival.tag, rows)
            return False
        self.unheard.discard(arrival.tag)
        self._gaps[arrival.tag] = 0
        if rows.length and kind == "can":
            self._record.traffic(robot, rows.rows)
        elif kind != "can":
            self._store_rows(robot, "plant" if kind == "plant" else "controller", rows)
        if rows.final:
            self.unfinished.discard(arrival.tag)
        return rows.length > 0 or rows.final

    def _give_up_if_gone(self, tag: str, rows: Rows) -> None:
        """A source with a gap has no row any more that could follow; others don't wait for it.

        One block that is ahead may be from another sender: the source itself goes on where it was.
        """
        kind, _, robot = tag.partition("/")
        if kind != "can":
            expected = self._expected(tag)
            self._gaps[tag] += expected is not None and rows.first_tick > expected
            if expected is not None and (rows.final or self._gaps[tag] >= GAPS):
                self._record.end(robot, "plant" if kind == "plant" else "controller")
        if rows.final:
            self.unfinished.discard(tag)

    def _fill_gap(self, tag: str, rows: Rows) -> None:
        """Of rows that a source said while it was cut off, only the time is known."""
        expected, first = self._expected(tag), rows.first_tick
        if expected is None or not (rows.length or rows.final) or not expected < first:
            return
        if first + rows.length > self._ticks or first - self._record.written > AHEAD_TICKS:
            return
        self._fill(tag, expected, first)

    def _fill(self, tag: str, expected: int, first: int) -> None:
        kind, _, robot = tag.partition("/")
        source: Source = "plant" if kind == "plant" else "controller"
        unknown = [nan] * (self._row_sizes[tag] // _TIME.size - 1)
        rest = struct.pack(f"<{len(unknown)}d", *unknown)
        for begin in range(expected, first, BLOCK_TICKS):
            ticks = range(begin, min(begin + BLOCK_TICKS, first))
            block = b"".join(_TIME.pack(tick * self._period_s) + rest for tick in ticks)
            self._record.add(robot, source, begin, block)
        self._filled[tag] += first - expected

    def _expected(self, tag: str) -> int | None:
        """The tick of the row that a source owes next, None if it has said its last."""
        kind, _, robot = tag.partition("/")
        return self._record.next_tick(robot, "plant" if kind == "plant" else "controller")

    # --- controllers that have left and may come again -------------------------------------------

    def _leaves(self, tag: str, rows: Rows) -> bool:
        """Take note of a controller that leaves with rows that it doesn't have, if this says so."""
        expected = self._expected(tag)
        away = rows.first_tick == self._ticks and not rows.length
        if not away or expected is None or expected >= self._ticks:
            return False
        self._absent.add(tag)
        self._away.add(tag)
        if rows.final:  # nobody waits for another at the end of the run
            self.unfinished -= {tag, tag.replace("controller", "inputs")}
        return True

    def _of_returned(self, tag: str, rows: Rows) -> Rows:
        """Rows of a controller that is there again, without those that count as lost already."""
        self._away.discard(tag)
        if not rows.final:
            self.unfinished |= {tag, tag.replace("controller", "inputs")} & self._tags
        expected = self._expected(tag)
        known = 0 if expected is None else min(max(expected - rows.first_tick, 0), rows.length)
        left = rows.rows[known * self._row_sizes[tag] :]
        return Rows(rows.first_tick + known, rows.length - known, left, rows.final)

    def _outwait(self, robot: str) -> None:
        """The rows of an absent controller count as lost where others would wait for too long."""
        tag = f"controller/{robot}"
        expected, reached = self._expected(tag), self._record.next_tick(robot, "plant")
        lost = 0 if reached is None else reached - self._patience_ticks
        if expected is not None and expected < lost:
            self._fill(tag, expected, lost)

    def end_absences(self) -> None:
        """The rows of controllers that have not come again are missing to the end of the run."""
        for tag in self._away:
            expected = self._expected(tag)
            if expected is not None:
                self._fill(tag, expected, max(self.ticks, expected))
                self._record.end(tag.partition("/")[2], "controller")

    def gaps(self) -> list[str]:
        """The rows that did not come, in words."""
        rows = [
            f"{count} rows of {_whose(tag)} did not come: not a number"
            for tag, count in self._filled.items()
        ]
        inputs = [
            f"{_whose(tag)} are missing from byte {at} of their log on"
            for tag, at in self._lost_inputs.items()
        ]
        return rows + inputs

    def _store_inputs(self, tag: str, robot: str, rows: Rows) -> bool:
        """Store a block of an input log; after one that did not come a log can't go on.

        A controller that was started again begins a new one.
        """
        expected = self._record.next_input(robot)
        again = rows.first_tick == 0 and rows.length > 0 and expected > 0
        may_come_again = self._fills_gaps or f"controller/{robot}" in self._absent
        if rows.first_tick == expected or (again and may_come_again):
            self._record.inputs(robot, rows.first_tick, rows.rows, rows.final)
        elif rows.first_tick > expected:
            self._lost_inputs.setdefault(tag, expected)
        else:
            self._refuse(tag, f"begins at byte {rows.first_tick}, expected {expected}")
            return False
        if rows.final:
            self.unfinished.discard(tag)
        return True

    def note_dropped(self, dropped: Iterable[Dropped]) -> None:
        """Count what found no room."""
        for tag, _, count in dropped:
            self._refuse(tag, "more of it waited already than there is room for", count)

    def note_foreign(self, refused: Mapping[str, int]) -> None:
        """Count packets of processes whose they can't be."""
        for process, count in refused.items():
            self.refusals.note("block", process, "not its own", count=count)

    def _refuse(self, tag: str, why: str, count: int = 1) -> None:
        kind = tag.partition("/")[0]
        what = {"can": "frame block", "inputs": "block"}.get(kind, "row block")
        self.refusals.note(what, _whose(tag), why.partition(" ")[0], why, count)

    def _wrong(self, kind: str, robot: str, rows: Rows) -> str | None:
        """Why a block can't be of this run, None if it can."""
        if kind == "can":
            return self._wrong_frames(rows)
        if not rows.length:
            return None  # a hello, or nothing more to say
        expected = self._expected(f"{kind}/{robot}")
        if expected is None:
            return f"tick {rows.first_tick} after its last"
        if rows.first_tick != expected:
            return f"begins at tick {rows.first_tick}, expected {expected}"
        if rows.length > BLOCK_TICKS or rows.first_tick + rows.length > self._ticks:
            return f"{rows.length} rows from tick {rows.first_tick} on; the run has {self._ticks}"
        if rows.first_tick - self._record.written > AHEAD_TICKS:
            return f"ahead of others by more than {AHEAD_TICKS} ticks"
        return None

    def _wrong_frames(self, rows: Rows) -> str | None:
        frames = frames_of(rows.rows)
        if rows.length > BLOCK_FRAMES:
            return f"{rows.length} frames, at most {BLOCK_FRAMES} travel together"
        if len(frames) and frames["length"].max() > MAX_DATA:
            return f"{frames['length'].max()} bytes of data in a frame"
        if len(frames) and frames["stamp_ns"].max() > self._last_frame_ns:
            return f"a frame at {frames['stamp_ns'].max() * 1e-9:.6g} s of bus time"
        return None

    def _store_rows(self, robot: str, source: Source, rows: Rows) -> None:
        if rows.length:
            self._record.add(robot, source, rows.first_tick, rows.rows)
            self.ticks = max(self.ticks, rows.first_tick + rows.length)
            if source == "plant" and f"controller/{robot}" in self._away:
                self._outwait(robot)
        if rows.final:
            self._record.end(robot, source)


def _whose(tag: str) -> str:
    kind, _, name = tag.partition("/")
    return _WHOSE[kind].format(name)


def run(brief: RecorderBrief, stop: Stop) -> str:
    """Record until every source said its last, or until told to stop and nothing comes any more.

    The time between arrivals is the network's, so it is read from the system's clock.
    """
    with (
        ExitStack() as opened,
        open_client(brief.network, brief.start_deadline_s) as link,
        RunRecord(
            Path(brief.path),
            dict(zip(brief.robots, brief.controllers, strict=True)),
            brief.scenario_toml,
            brief.period_ns,
            buses=brief.buses,
            formats=brief.bus_formats,
            inputs=brief.robots if brief.logged_inputs else (),
            drawing=brief.drawing,
        ) as record,
    ):
        name = brief.network.run
        recorder = _Recorder(brief, record)
        ears = opened.enter_context(open_ears(brief, link))
        progress = link.publisher(keys.progress(name, RECORDER.name))
        report = link.publisher(keys.report(name, RECORDER.name))
        await_hellos(
            ears,
            Hellos(brief.hello_every_s),
            recorder.process,
            lambda: sorted(recorder.unheard),
            name=RECORDER.name,
            within_s=brief.start_deadline_s,
            stop=stop,
        )
        link.declare_live(keys.live(name, RECORDER.name))
        began_ns = process_cpu_ns()
        quiet_since = now = next_report = SYSTEM_CLOCK.monotonic_s()
        while recorder.unfinished:
            arrival = ears.receive(max(next_report - now, 0.0))
            now = SYSTEM_CLOCK.monotonic_s()
            if arrival is not None and recorder.process(arrival):
                quiet_since = now
            elif arrival is not None:
                SYSTEM_CLOCK.sleep(0.0)  # of a flood: let the network's thread have its turn
            elif stop.requested and now - quiet_since > QUIET_S:
                break
            if now >= next_report:
                next_report = now + PROGRESS_EVERY_S
                record.check_place()
                record.flush()
                progress.put(Progress(recorder.ticks, 0, 0).encode())
        recorder.end_absences()
        recorder.note_dropped(link.dropped())
        recorder.note_foreign(ears.refused)
        lost = refused = recorder.refusals.lines()
        if recorder.unfinished:
            missing = ", ".join(sorted(recorder.unfinished))
            lost = [*refused, f"the run ended before the last of {missing} came"]
        if lost:
            record.note_lost("; ".join(lost))
        summary = Report(
            remarks=(*recorder.gaps(), *refused),
            flooders=tuple(recorder.refusals.floods()),
            cpu_ns=process_cpu_ns() - began_ns,
        )
        report.put(summary.encode())
        stop.await_release()
    return f"{brief.path} has {recorder.ticks} ticks"


def _tidy(brief: RecorderBrief) -> None:
    """What the launcher would have done."""
    sockets.remove_run_folder(Path(brief.runtime_folder))


def main() -> int:
    """Serve as the recorder; return the exit status."""
    return serve(RecorderBrief, run, name=RECORDER.name, orphaned=_tidy)


if __name__ == "__main__":
    raise SystemExit(main())
