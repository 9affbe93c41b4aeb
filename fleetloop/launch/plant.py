"""`fleetloop plant`: emulated drives and physics alone, in real time, for the user's own host code.

No controllers, no network, no countdown: the bodies are free from the start, and whoever opens a
bus may arm its drives and drive. It ends with a signal, after `--duration`, or with its standard
input if that is served: then each line asks, and is answered by a line of JSON.

    poses           bus time, and of each robot pose, speeds and the torques that act on its wheels
    inject TABLE    a fault with the keys of [[fault]], as JSON; answered with its name and tick
    clear NAME      ends a fault that was injected

With `--join` it is the plant of a run whose deployment has the role elsewhere, for example on the
machine with the CAN adapters.
"""

import json
import os
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bridge.can_bus import sockets
from bridge.can_bus.drive_port import DrivePort
from bridge.can_bus.hub import Hub
from bridge.network.messages import Progress
from bridge.network.telemetry import PLANT_ROW, RowBuffer
from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop, keep_to_itself, name_process, settled_memory
from bridge.process.scheduling import go_realtime
from configs.brief import PlantBrief
from configs.connections import NetworkLink, Settings
from configs.deployment import Deployment, load_deployment
from configs.errors import ExitStatus, ScenarioError
from configs.loading import load
from configs.overrides import Override, Overrides
from configs.resolve import plant_brief
from configs.roles import PLANT
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS
from fleetloop.json_lines import JsonLines
from fleetloop.launch import open_files, placement
from fleetloop.launch.plant_faults import PlantFaults
from fleetloop.signals import stop_on_signals
from fleetloop.terminal import note, say
from plant.__main__ import PLANT_PRIORITY, join
from plant.__main__ import run as plant_of_a_run
from plant.realtime import RealtimeLoop
from plant.robot import EmulatedRobot, emulated_robot
from plant.troubles import bus_troubles, diverged_robots

FOREVER_TICKS = 1 << 53
GO_AHEAD_NS = 1_000_000
_WALL_CLOCK = Override("a plant on its own", "clock.mode", "realtime")
_ROW_NAMES = [signal.name for signal in PLANT_SIGNALS]


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """Options of the command line."""

    robots: tuple[str, ...] = ()
    duration_s: float | None = None
    deployment: Path | None = None
    overrides: Overrides = ()
    as_json: bool = False
    json_lines: bool = False
    serve_stdin: bool = False
    join: bool = False


class _Nowhere:
    """Poses have no listener here."""

    def put(self, payload: object) -> None:
        """Forget it."""


class _Watch:
    """Says which robot's motion diverged, as soon as it is seen."""

    def __init__(
        self, robots: Sequence[EmulatedRobot], period_ns: int, say: Callable[[str, str], None]
    ) -> None:
        self._robots = robots
        self._say = say
        self._period_ns = period_ns
        self._told: set[str] = set()

    def look(self, _: Progress | None = None) -> None:
        """Print new events."""
        for robot, why in diverged_robots(self._robots, self._period_ns).items():
            if robot not in self._told:
                self._told.add(robot)
                self._say(robot, f"STOPPED {robot}: {why}; its drives are disarmed for good")


def run_plant(source: str, options: PlantOptions) -> int:
    """Emulate drives and bodies until told to stop; return the exit status.

    Raises:
        ScenarioError: scenario, robot or deployment is wrong; nothing was opened.
        InfrastructureError: a bus can't be opened.
    """
    scenario = load(source, (*options.overrides, _WALL_CLOCK))
    deployment = Deployment()
    if options.deployment is not None:
        deployment = load_deployment(options.deployment, scenario)
    if options.json_lines and (options.join or options.serve_stdin):
        raise ScenarioError("--json-lines: for a plant on its own, without --join and --stdin")
    if options.join:
        return _join(scenario, deployment)
    brief = plant_brief(scenario, network=NetworkLink("alone", "", "", ""))
    brief = _alone(placement.robots_of_plant(brief, deployment), options)
    name_process(f"plant {scenario.name}")
    open_files.ensure(1)
    attached = {bus for bus, _ in brief.attached}
    ours = [bus for bus in dict.fromkeys(r.bus for r in brief.robots) if bus not in attached]
    queue = brief.wire.txqueuelen if brief.wire else 0
    with (
        stop_on_signals() as stop,
        sockets.run_folder(f"{scenario.name}-{os.getpid()}") as folder,
    ):
        hub = Hub(sockets.listen(folder, ours), stop.wake_fd, queue=queue)
        end: DrivePort = hub
        try:
            end = join(hub, brief.attached)
            faults = PlantFaults(scenario, brief.schedule, [r.robot for r in brief.robots])
            _run(brief, hub, end, _buses(brief, folder), options, stop, faults)
        finally:
            end.close(stop.reason or "the plant has ended")
    return ExitStatus.OK


def _join(scenario: Scenario, deployment: Deployment) -> int:
    """Run as the plant of a launcher on another machine."""
    keep_to_itself()
    network = placement.network_link(scenario, deployment, PLANT.name)
    brief = placement.robots_of_plant(plant_brief(scenario, network=network), deployment)
    attached = {bus for bus, _ in brief.attached}
    ours = [bus for bus in dict.fromkeys(r.bus for r in brief.robots) if bus not in attached]
    with stop_on_signals() as stop, sockets.run_folder(f"{network.run}-plant") as folder:
        note(f"plant: waiting for run {network.run!r} at {network.endpoint}")
        listeners = sockets.listen(folder, ours)
        brief = replace(
            brief,
            listeners=tuple((bus, listener.detach()) for bus, listener in listeners.items()),
            detached=True,
        )
        name_process("plant")
        word = plant_of_a_run(brief, stop)
    note(f"plant: {word}{f'; {stop.reason}' if stop.reason else ''}")
    interrupted = stop.reason.startswith("interrupted")
    return ExitStatus.INTERRUPTED if interrupted else ExitStatus.OK


def _alone(brief: PlantBrief, options: PlantOptions) -> PlantBrief:
    """Only these robots, without countdown, for as long as it takes."""
    emulated = tuple(robot.robot for robot in brief.robots)
    for robot in options.robots:
        if robot not in emulated:
            known = ", ".join(emulated) or "none"
            raise ScenarioError(f"--robots {robot}: not emulated here; known: {known}")
    names = options.robots or emulated
    ticks = FOREVER_TICKS
    if options.duration_s is not None:
        ticks = max(round(options.duration_s / brief.schedule.period_s), 1)
    return replace(
        brief,
        robots=tuple(robot for robot in brief.robots if robot.robot in names),
        attached=tuple(bus for bus in brief.attached if bus[0] in names),
        schedule=replace(brief.schedule, countdown_ticks=0, ticks=ticks),
    )


def _buses(brief: PlantBrief, folder: Path) -> dict[str, Settings]:
    """Keyword arguments of `can.Bus` for host code, by robot."""
    attached = dict(brief.attached)
    return {
        robot.robot: attached.get(robot.bus)
        or (("channel", str(sockets.socket_path(folder, robot.bus))), ("interface", "fleetloop"))
        for robot in brief.robots
    }


def _run(
    brief: PlantBrief,
    hub: Hub,
    end: DrivePort,
    buses: dict[str, Settings],
    options: PlantOptions,
    stop: Stop,
    faults: PlantFaults,
) -> None:
    robots = [emulated_robot(robot) for robot in brief.robots]
    nowhere = _Nowhere()
    lines = JsonLines() if options.json_lines else None

    def tell(source: str, text: str) -> None:
        if lines is None:
            note(text)
        else:
            lines.say("note", source=source, text=text)

    watch = _Watch(robots, brief.schedule.period_ns, tell)
    rows = [RowBuffer(PLANT_ROW, lambda *_: None) for _ in robots]
    poses = [nowhere] * len(robots)
    loop = RealtimeLoop(brief, robots, end, hub, poses, rows, watch.look, {}, orders=faults.orders)
    missing = go_realtime(PLANT_PRIORITY)
    if options.serve_stdin:
        threading.Thread(
            target=_serve_stdin, args=(robots, loop, faults, stop), daemon=True
        ).start()
    if lines is not None:
        named = {robot: dict(bus) for robot, bus in buses.items()}
        lines.say("started", command="plant", buses=named)
    else:
        _say_ready(brief, buses, as_json=options.as_json)
    with settled_memory():
        loop.run(SYSTEM_CLOCK.monotonic_ns() + GO_AHEAD_NS, stop)
    watch.look()
    for bus, trouble in bus_troubles(end.troubles(), robots).items():
        tell(f"bus/{bus}", f"BUS {bus}: {trouble}")
    if lines is not None:
        counters = loop.counters
        lines.say(
            "ended",
            exit_status=int(ExitStatus.OK),
            wall_s=counters.wall_ns * 1e-9,
            frames=counters.frames,
            late_ticks=counters.overruns,
        )
        lines.end()
        return
    frames = ", ".join(f"{bus} {count}" for bus, count in loop.counters.frames.items())
    late = f"; late ticks: {loop.counters.overruns}" if loop.counters.overruns else ""
    jitter = f" (missing privileges: {', '.join(missing)})" if late and missing else ""
    if not options.as_json:
        note(f"{loop.counters.wall_ns * 1e-9:.1f} s; frames: {frames}{late}{jitter}")


def _say_ready(brief: PlantBrief, buses: dict[str, Settings], *, as_json: bool) -> None:
    if as_json:
        say(json.dumps({"buses": {robot: dict(bus) for robot, bus in buses.items()}}))
        return
    for robot in brief.robots:
        bus = dict(buses[robot.robot])
        channel = bus["channel"]
        if bus["interface"] == "fleetloop":
            channel = sockets.name_of(Path(str(channel)))
        say(
            f"{robot.robot}  interface={bus['interface']} channel={channel}"
            f"  right node {robot.right_node}, left node {robot.left_node}"
        )
    note("drives and physics in real time; Ctrl-C ends")


def _serve_stdin(
    robots: Sequence[EmulatedRobot], loop: RealtimeLoop, faults: PlantFaults, stop: Stop
) -> None:
    """Answer requests until standard input ends, and the plant with it."""
    for line in sys.stdin:
        request, _, words = line.strip().partition(" ")
        try:
            match request:
                case "poses":
                    answer = _poses(robots, loop)
                case "inject":
                    answer = faults.inject(_table(words), loop.progress().tick)
                case "clear":
                    answer = faults.clear(words)
                case other:
                    known = "poses, inject, clear"
                    answer = {"error": f"{other[:40]!r}: no such request; known: {known}"}
        except ScenarioError as error:
            answer = {"error": str(error)}
        say(json.dumps(answer))
    stop.request("standard input has ended")


def _table(text: str) -> dict[str, Any]:
    try:
        table = json.loads(text)
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise ScenarioError("inject: takes a table of [[fault]] as JSON")
    return table


def _poses(robots: Sequence[EmulatedRobot], loop: RealtimeLoop) -> dict[str, Any]:
    poses = {}
    for robot in robots:
        state, row = robot.state, dict(zip(_ROW_NAMES, robot.row(0.0), strict=True))
        poses[robot.brief.robot] = {
            "x_m": state.x,
            "y_m": state.y,
            "theta_rad": state.theta,
            "v_m_s": state.v,
            "omega_rad_s": state.omega,
            "torque_right_wheel_N_m": row["motor_right_wheel_N_m"],
            "torque_left_wheel_N_m": row["motor_left_wheel_N_m"],
        }
    return {"t_s": round(loop.progress().t_ns * 1e-9, 9), "robots": poses}
