"""Relations within [drive], and to the clock, the encoders and the nodes on each bus."""

from collections.abc import Iterator

from configs.errors import Problem
from configs.plugins import raised
from configs.scenario import Scenario

MAX_NODE = 62
"""63 is the address of drives that have none."""


def drive_problems(scenario: Scenario) -> Iterator[Problem]:
    """Problems of [drive], of its protocol's own keys, of its nodes, the clock and the encoders."""
    drive = scenario.drive
    if drive.right_node == drive.left_node:
        yield Problem("drive.left_node", drive.left_node, "must differ from drive.right_node")
    else:
        yield from _nodes(scenario)
    least_s, most_s = drive.command_latency_s
    if least_s > most_s:
        yield Problem("drive.command_latency_s", [least_s, most_s], "least before most")
    yield from _encoder_period(scenario)
    yield from _own(scenario)
    encoder = scenario.encoder
    if 2.0 * encoder.pll_bandwidth_rad_s >= encoder.pll_rate_Hz:
        yield Problem(
            "encoder.pll_bandwidth_rad_s",
            encoder.pll_bandwidth_rad_s,
            f"must be below half of encoder.pll_rate_Hz = {encoder.pll_rate_Hz:g}, as drives want"
            " it: twice the bandwidth times the loop period is a gain below 1",
        )


def _own(scenario: Scenario) -> Iterator[Problem]:
    """What the protocol's section finds itself; its code may be a user's."""
    try:
        yield from scenario.drive.problems(scenario.clock, scenario.host)
    except Exception as error:
        yield Problem("drive.protocol", scenario.drive_choice.name, f"its check: {raised(error)}")


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
