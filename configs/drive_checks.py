"""Relations within [drive], and to the clock, the encoders and the nodes on each bus."""

from collections.abc import Iterator

from pydantic import ValidationError

from configs.drives import choice_of
from configs.errors import Problem
from configs.plugins import PluginError
from configs.scenario import Scenario
from configs.sections import Drive
from configs.wording import remedy_of

MAX_NODE = 62
"""63 is the address of drives that have none."""

_WHOLE_MILLISECONDS = (
    "heartbeat_period_s",
    "encoder_period_s",
    "torques_period_s",
    "error_period_s",
    "iq_period_s",
    "temperature_period_s",
    "bus_voltage_period_s",
    "powers_period_s",
)


def drive_problems(scenario: Scenario) -> Iterator[Problem]:
    """Problems of [drive] with its protocol, its nodes, the clock and the encoders."""
    drive = scenario.drive
    yield from _protocol(drive)
    if drive.right_node == drive.left_node:
        yield Problem("drive.left_node", drive.left_node, "must differ from drive.right_node")
    else:
        yield from _nodes(scenario)
    least_s, most_s = drive.command_latency_s
    if least_s > most_s:
        yield Problem("drive.command_latency_s", [least_s, most_s], "least before most")
    for key in _WHOLE_MILLISECONDS:
        period_s = getattr(drive, key) or 0.0
        if abs(period_s * 1e3 - round(period_s * 1e3)) > 1e-6:
            yield Problem(f"drive.{key}", period_s, "whole milliseconds, as drives have them")
    yield from _encoder_period(scenario)
    if drive.under_voltage_V >= drive.over_voltage_V:
        above = f"must be below drive.over_voltage_V = {drive.over_voltage_V:g}"
        yield Problem("drive.under_voltage_V", drive.under_voltage_V, above)
    if drive.derate_from_C >= drive.derate_to_C:
        above = f"must be below drive.derate_to_C = {drive.derate_to_C:g}"
        yield Problem("drive.derate_from_C", drive.derate_from_C, above)
    if drive.watchdog_s and drive.watchdog_s < 2 * scenario.clock.control_period_s:
        yield Problem(
            "drive.watchdog_s",
            drive.watchdog_s,
            "0 (off) or at least two control periods, or every torque comes too late",
        )
    encoder = scenario.encoder
    if 2.0 * encoder.pll_bandwidth_rad_s >= encoder.pll_rate_Hz:
        yield Problem(
            "encoder.pll_bandwidth_rad_s",
            encoder.pll_bandwidth_rad_s,
            f"must be below half of encoder.pll_rate_Hz = {encoder.pll_rate_Hz:g}, as drives want"
            " it: twice the bandwidth times the loop period is a gain below 1",
        )


def _protocol(drive: Drive) -> Iterator[Problem]:
    """The protocol exists, and its own keys are right."""
    try:
        choice_of(drive)
    except ValidationError as error:
        for item in error.errors(include_url=False):
            key = ".".join(map(str, ("drive", "options", *item["loc"])))
            yield Problem(key, item["input"], remedy_of(item))
    except PluginError as error:
        yield Problem("drive.protocol", drive.protocol, str(error))


def _encoder_period(scenario: Scenario) -> Iterator[Problem]:
    period_s, control_s = scenario.drive.encoder_period_s, scenario.clock.control_period_s
    if period_s is None:
        return
    ratio = control_s / period_s
    if ratio < 1.0 - 1e-6:
        remedy = f"at most clock.control_period_s = {control_s:g}: a tick needs news of both wheels"
        yield Problem("drive.encoder_period_s", period_s, remedy)
    elif scenario.clock.mode == "lockstep" and abs(ratio - round(ratio)) > 1e-6:
        remedy = f"must divide clock.control_period_s = {control_s:g}, the tick of lockstep"
        yield Problem("drive.encoder_period_s", period_s, remedy)


def _nodes(scenario: Scenario) -> Iterator[Problem]:
    taken: dict[tuple[str, int], str] = {}
    for name in scenario.names:
        bus = scenario.bus_of(name)
        for side, node in zip(("right", "left"), scenario.nodes_of(name), strict=True):
            key = f"robot.{name}.{side}_node"
            if node > MAX_NODE:
                remedy = f"bus {bus} has no node left for it: 0 to {MAX_NODE}"
                yield Problem(key, node, remedy)
            elif (owner := taken.setdefault((bus, node), f"{name}'s {side} drive")) and (
                owner != f"{name}'s {side} drive"
            ):
                yield Problem(key, node, f"on bus {bus} it is {owner} already; choose another")
