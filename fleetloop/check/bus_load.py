"""Load and worst-case response times of a scenario's buses, against what a wire carries.

The cyclic messages of drives and controllers are those of the drive protocol's row. Typical lengths
are those of moving wheels; worst cases are `bridge.wire.response_time`'s. Robots that share a bus
are taken together.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from statistics import fmean

from bridge.drives import protocol
from bridge.drives.interface import CyclicMessage
from bridge.drives.wrapped import Own
from bridge.frame import Frame
from bridge.wire.bits import frame_bits
from bridge.wire.response_time import Analysis, Message, analyse
from configs.brief import RobotBrief
from configs.scenario import Scenario
from fleetloop.check.finding import Finding

_BASIS = "frame lengths, worst-case response times"


def bus_findings(scenario: Scenario, robots: Sequence[RobotBrief]) -> list[Finding]:
    """One finding per bus of the robots.

    On a wire it is an error if even the mean load is more than it carries: a backlog grows. Below
    that a backlog works itself off, so a load above the ceiling, or a message that can be late when
    all are due at once, is a warning.
    """
    buses: dict[str, list[RobotBrief]] = {}
    for robot in robots:
        buses.setdefault(robot.bus, []).append(robot)
    period_ns = round(scenario.clock.control_period_s * 1e9)
    found = []
    for sharing in buses.values():
        analysis = analyse(bus_messages(sharing, period_ns), scenario.bus.bitrate_bit_s)
        found.append(_finding(scenario, tuple(robot.robot for robot in sharing), analysis))
    return found


def bus_messages(robots: Iterable[RobotBrief], period_ns: int) -> list[Message]:
    """All periodic messages of the robots of one bus, torques every `period_ns`."""
    messages = []
    for robot in robots:
        mounting = robot.mounting
        plugin = robot.drive.choice.plugin
        own, method = Own(plugin, f"drives of {robot.robot}"), protocol(plugin).cyclic_messages
        for node, sign in (
            (robot.right_node, mounting.right_sign),
            (robot.left_node, mounting.left_sign),
        ):
            gear = sign * mounting.gear_ratio
            asked = (robot.drive, node, period_ns, gear)
            messages += own.ask("cyclic_messages", method, _messages, *asked)
    return messages


def _messages(cyclic: Iterable[CyclicMessage]) -> list[Message]:
    return [
        Message(
            can_id,
            len(payloads[0]),
            every_ns,
            fmean(frame_bits(Frame(can_id, data)) for data in payloads),
        )
        for can_id, every_ns, payloads in cyclic
    ]


def _finding(scenario: Scenario, robots: tuple[str, ...], analysis: Analysis) -> Finding:
    rate, ceiling = scenario.bus.bitrate_bit_s, scenario.bus.load_ceiling
    count = len(analysis.messages)
    shared = "" if len(robots) == 1 else f" that {len(robots)} robots share"
    title = f"bus at {rate / 1000:g} kbit/s{shared}"
    slowest = analysis.slowest
    late = sum(not message.schedulable for message in analysis.messages)
    period_ms = slowest.period_ns * 1e-6
    if slowest.response_ns is None:
        timing = f"0x{slowest.can_id:X} every {period_ms:g} ms may never be sent"
    else:
        timing = f"0x{slowest.can_id:X} takes up to {slowest.response_ns * 1e-6:.3g} ms"
        timing += f" of its {period_ms:g} ms"
    text = (
        f"{count} messages, load {analysis.mean_load:.1%} mean, {analysis.worst_load:.1%} worst;"
        f" {timing}"
    )
    limit = f"≤ ceiling {ceiling:.0%}, in time"
    fine = Finding("ok", title, text, robots, limit=limit, basis=_BASIS)
    if analysis.worst_load <= ceiling and analysis.schedulable:
        return fine
    if late:
        text += f"; {late} of {count} can come too late"
    if scenario.bus.timing == "ideal":
        text += ": no real bus can, the ideal one does"
        return replace(fine, level="warning", value=text)
    key = "bus.bitrate_bit_s"
    if analysis.mean_load < 1.0:
        if late:
            usually = all(message.usually_schedulable for message in analysis.messages)
            text += ", but only when all are due at once" + (" and longest" if usually else "")
        remedy = ""
        if analysis.worst_load > ceiling:
            remedy = "lower the rates, put fewer robots on a bus, or raise bus.load_ceiling"
        return replace(fine, level="warning", value=text, key=key, remedy=remedy)
    remedy = "lower the rates, or put fewer robots on a bus"
    return replace(fine, level="error", value=text, key=key, remedy=remedy)
