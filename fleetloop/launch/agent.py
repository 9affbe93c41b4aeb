"""`fleetloop agent`: one robot's controller in this process, as it runs on the robot.

It has no launcher beside it. It waits for the router of its deployment, says that it is ready, and
drives when the run says go; it ends with the run, on a signal, or when the launcher's token or the
way to it is gone. However it ends, it leaves its drives disarmed if it can still send.
"""

from dataclasses import replace
from pathlib import Path

from agents.__main__ import run
from bridge.network.launcher import RUN_ENDED
from bridge.process.lifecycle import LAUNCHER_GONE, keep_to_itself
from configs.deployment import load_deployment
from configs.errors import ExitStatus, InfrastructureError, ScenarioError
from configs.loading import load
from configs.overrides import Overrides
from configs.resolve import agent_brief
from configs.roles import AGENT
from fleetloop.launch import placement
from fleetloop.signals import stop_on_signals
from fleetloop.terminal import note


def run_agent(source: str, robot: str, deployment_file: Path, overrides: Overrides) -> int:
    """Run one controller until its run ends; return the exit status.

    Raises:
        ScenarioError: scenario, robot or deployment is wrong; nothing was opened.
        InfrastructureError: no router, no bus, or the run failed.
    """
    scenario = load(source, overrides)
    if robot not in scenario.names:
        known = ", ".join(scenario.names)
        raise ScenarioError(f"{robot}: no such robot in {source}; known: {known}")
    if scenario.clock.mode != "realtime":
        raise ScenarioError(
            f'{source}: clock.mode = "{scenario.clock.mode}": a controller on its own keeps the'
            ' wall clock; it must be "realtime" (--clock realtime)'
        )
    deployment = load_deployment(deployment_file, scenario)
    role = AGENT.process(robot)
    keep_to_itself()
    network = placement.network_link(scenario, deployment, role)
    bus = placement.agent_bus(deployment, robot)
    brief = replace(agent_brief(scenario, robot, network=network, bus=bus), detached=True)
    settings = " ".join(f"{key}={value}" for key, value in deployment.bus_of(robot))
    with stop_on_signals() as stop:
        note(f"{role}: {settings}; waiting for run {network.run!r} at {network.endpoint}")
        early = run(brief, stop)
    if early == LAUNCHER_GONE:
        early += ", or the network to it"
    elif not early.startswith(RUN_ENDED):
        note(f"{role}: {early or 'end of the run'}")
        return ExitStatus.INTERRUPTED if early else ExitStatus.OK
    raise InfrastructureError(f"{role}: {early}: drives disarmed")
