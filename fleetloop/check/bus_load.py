"""What a scenario asks of its buses: load, worst-case response times, and whether that can be.

Per robot and bus: two heartbeats and two encoder frames from the drives, two torque frames from the
controller every period, and what else of the drives the scenario makes cyclic. Typical lengths are
those of moving wheels; worst cases are `bridge.wire.response_time`'s. Robots that share a bus are
taken together.
"""

from collections.abc import Iterable, Sequence
from statistics import fmean

from bridge.drives.odrive.frames import (
    HEARTBEAT,
    ONE_FLOAT,
    TWO_FLOATS,
    AxisState,
    Command,
    identifier,
)
from bridge.frame import Frame
from bridge.wire.bits import frame_bits
from bridge.wire.response_time import Analysis, Message, analyse
from configs.brief import RobotBrief
from configs.scenario import Scenario
from fleetloop.check.finding import Finding

_SAMPLES = 64
_TYPICAL_REV_S = 2.4  # a wheel of 4 cm radius at 0.6 m/s
_TYPICAL_N_M = 0.05


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
    return [
        message
        for robot in robots
        for node in (robot.right_node, robot.left_node)
        for message in _axis_messages(robot, node, period_ns)
    ]


def _axis_messages(robot: RobotBrief, node: int, period_ns: int) -> list[Message]:
    drive = robot.drive
    heartbeat = HEARTBEAT.pack(0, AxisState.CLOSED_LOOP_CONTROL, 0, 0, 0)
    moving = [_TYPICAL_REV_S * (1 + 0.001 * n) for n in range(_SAMPLES)]
    torques = [_TYPICAL_N_M * (1 + 0.01 * n) for n in range(_SAMPLES)]
    cyclic: dict[Command, tuple[int, Sequence[bytes]]] = {
        Command.HEARTBEAT: (drive.heartbeat_period_ns, [heartbeat]),
        Command.GET_ENCODER_ESTIMATES: (
            drive.encoder_period_ns,
            [TWO_FLOATS.pack(0.0024 * n, speed) for n, speed in enumerate(moving, 1)],
        ),
        Command.SET_INPUT_TORQUE: (period_ns, [ONE_FLOAT.pack(torque) for torque in torques]),
        Command.GET_TORQUES: (
            drive.torques_period_ns,
            [TWO_FLOATS.pack(torque, torque * 1.003) for torque in torques],
        ),
    }
    others = [TWO_FLOATS.pack(24.0 - 0.01 * n, 0.3 + 0.003 * n) for n in range(_SAMPLES)]
    more: dict[Command, tuple[int, Sequence[bytes]]] = {
        Command.GET_ERROR: (drive.error_period_ns, [bytes(8)]),
        Command.GET_IQ: (drive.iq_period_ns, others),
        Command.GET_TEMPERATURE: (drive.temperature_period_ns, others),
        Command.GET_BUS_VOLTAGE_CURRENT: (drive.bus_voltage_period_ns, others),
        Command.GET_POWERS: (drive.powers_period_ns, others),
    }
    messages = []
    for command, (every_ns, samples) in (cyclic | more).items():
        if every_ns:
            can_id = identifier(node, command)
            mean = fmean(frame_bits(Frame(can_id, data)) for data in samples)
            messages.append(Message(can_id, len(samples[0]), every_ns, mean))
    return messages


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
        f"{count} messages, load {analysis.mean_load:.1%} mean, {analysis.worst_load:.1%} worst"
        f" (ceiling {ceiling:.0%}); {timing}"
    )
    if analysis.worst_load <= ceiling and analysis.schedulable:
        return Finding("ok", title, text, robots)
    if late:
        text += f"; {late} of {count} can come too late"
    if scenario.bus.timing == "ideal":
        return Finding("warning", title, f"{text}: no real bus can, the ideal one does", robots)
    if analysis.mean_load < 1.0:
        if late:
            usually = all(message.usually_schedulable for message in analysis.messages)
            text += ", but only when all are due at once" + (" and longest" if usually else "")
        if analysis.worst_load > ceiling:
            text += ": lower the rates, put fewer robots on a bus, or raise bus.load_ceiling"
        return Finding("warning", title, text, robots, "bus.bitrate_bit_s")
    text += ": lower the rates, or put fewer robots on a bus"
    return Finding("error", title, text, robots, "bus.bitrate_bit_s")
