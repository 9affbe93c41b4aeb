"""The recorder's process: hears every robot's rows and writes `record.mcap`.

It stands apart from the lockstep path, so that neither writing nor a slow disk costs a tick, and it
outlives the launcher for as long as it takes to complete the file. Started by `fleetloop run`.
"""

import time
from pathlib import Path

from bridge import keys
from bridge.barrier import Hellos, await_hellos
from bridge.can_bus import places
from bridge.link import Arrival
from bridge.messages import Progress, Report, Rows
from bridge.process import Stop, cpu_ns, serve
from bridge.telemetry import AGENT_ROW, FRAME_ROW, PLANT_ROW
from bridge.zenoh_link import open_client
from configs.brief import RecorderBrief
from fleetloop.record.run_record import RunRecord
from fleetloop.record.writer import Source

QUIET_S = 0.3
"""Once asked to stop, the recorder takes what still comes until nothing came for this long."""
PROGRESS_EVERY_S = 0.25
_ROW_SIZES = {"plant": PLANT_ROW.size, "controller": AGENT_ROW.size, "can": FRAME_ROW.size}


class _Recorder:
    def __init__(self, brief: RecorderBrief, record: RunRecord) -> None:
        self._record = record
        sources = {f"{kind}/{r}" for r in brief.robots for kind in ("plant", "controller")}
        sources |= {f"can/{bus}" for bus in brief.buses}
        self.unheard = set(sources)
        self.unfinished = set(sources)
        self.undecodable = 0
        self.ticks = 0

    def take(self, arrival: Arrival) -> None:
        kind, _, robot = arrival.tag.partition("/")
        rows = Rows.decode(arrival.payload, _ROW_SIZES[kind])
        if rows is None:
            self.undecodable += 1
            return
        self.unheard.discard(arrival.tag)
        if rows.length and kind == "can":
            self._record.traffic(robot, rows.rows)
        elif kind != "can":
            self._take_rows(robot, "plant" if kind == "plant" else "controller", rows)
        if rows.final:
            self.unfinished.discard(arrival.tag)

    def _take_rows(self, robot: str, source: Source, rows: Rows) -> None:
        if rows.length:
            self._record.add(robot, source, rows.first_tick, rows.rows)
            self.ticks = max(self.ticks, rows.first_tick + rows.length)
        if rows.final:
            self._record.end(robot, source)


def run(brief: RecorderBrief, stop: Stop) -> str:
    """Record until every source said its last, or until told to stop and nothing comes any more."""
    with (
        open_client(brief.network, brief.start_deadline_s) as link,
        RunRecord(
            Path(brief.path),
            brief.robots,
            brief.scenario_toml,
            brief.period_ns,
            buses=brief.buses,
            formats=brief.bus_formats,
        ) as record,
    ):
        name = brief.network.run
        recorder = _Recorder(brief, record)
        for robot in brief.robots:
            link.subscribe(keys.truth(name, robot), f"plant/{robot}")
            link.subscribe(keys.telemetry(name, robot), f"controller/{robot}")
        for bus in brief.buses:
            link.subscribe(keys.traffic(name, bus), f"can/{bus}")
        progress = link.publisher(keys.progress(name, "recorder"))
        report = link.publisher(keys.report(name, "recorder"))
        await_hellos(
            link,
            Hellos(brief.hello_every_s),
            recorder.take,
            lambda: sorted(recorder.unheard),
            who="recorder",
            within_s=brief.start_deadline_s,
            stop=stop,
        )
        link.declare_live(keys.live(name, "recorder"))
        next_report = 0.0
        began_ns = cpu_ns()
        quiet_since = time.monotonic()
        while recorder.unfinished:
            arrival = link.receive(PROGRESS_EVERY_S)
            now = time.monotonic()
            if arrival is not None:
                recorder.take(arrival)
                quiet_since = now
            elif stop.requested and now - quiet_since > QUIET_S:
                break
            if now >= next_report:
                next_report = now + PROGRESS_EVERY_S
                record.flush()
                progress.put(Progress(recorder.ticks, 0, 0).encode())
        if recorder.unfinished:
            missing = ", ".join(sorted(recorder.unfinished))
            record.note_lost(f"the run ended before the last of {missing} came")
        values = {"undecodable": recorder.undecodable, "cpu_ns": cpu_ns() - began_ns}
        report.put(Report(values).encode())
        stop.await_release()
    return f"{brief.path} has {recorder.ticks} ticks"


def _tidy(brief: RecorderBrief) -> None:
    """What the launcher would have done."""
    places.remove_run_folder(Path(brief.runtime_folder))


if __name__ == "__main__":
    raise SystemExit(serve(RecorderBrief, run, name="recorder", orphaned=_tidy))
