"""One robot's controller process. The only file here that wires things.

Started by `fleetloop run` with an `AgentBrief` on standard input.
"""

from typing import Any

import can

from agents.agent import Agent
from agents.loop import LockstepLoop
from bridge import keys
from bridge.barrier import Hellos, await_hellos
from bridge.link import Link
from bridge.messages import Report, Rows
from bridge.process import Stop, name_process, serve, settle_memory
from bridge.telemetry import AGENT_ROW, RowBuffer
from bridge.zenoh_link import open_client
from configs.brief import AgentBrief
from configs.errors import InfrastructureError


def run(brief: AgentBrief, stop: Stop) -> None:
    """Wire one agent to its bus and the network, wait for its peers, and run."""
    name_process(brief.robot)
    with open_client(brief.network, brief.schedule.start_deadline_s) as link:
        try:
            # Verbatim from the deployment: python-can checks what its interface takes.
            settings: dict[str, Any] = dict(brief.bus)
            bus = can.Bus(**settings)
        except can.CanError as error:
            raise InfrastructureError(f"{brief.robot}: no bus: {error}") from error
        with bus:
            _run(brief, stop, link, bus)


def _run(brief: AgentBrief, stop: Stop, link: Link, bus: can.BusABC) -> None:
    name, robot = brief.network.run, brief.robot
    path = link.publisher(keys.path(name, robot))
    telemetry = link.publisher(keys.telemetry(name, robot))
    report = link.publisher(keys.report(name, f"agent/{robot}"))
    rows = RowBuffer(
        AGENT_ROW,
        lambda first, count, block, final: telemetry.put(Rows(first, count, block, final).encode()),
    )
    agent = Agent(brief, rows)
    link.subscribe(keys.pose(name, robot), "pose")
    for neighbour in brief.hears:
        link.subscribe(keys.path(name, neighbour), f"path/{neighbour}")
    if brief.hears_leader:
        link.subscribe(keys.leader_speed(name), "leader")

    hellos = Hellos()
    hellos.add(path, agent.share(-1).encode())
    hellos.add(telemetry, Rows(0, 0, b"", False).encode())
    loop = LockstepLoop(agent, bus, link, path, hellos)
    await_hellos(
        link,
        hellos,
        loop.take,
        agent.missing_to_start,
        who=robot,
        within_s=brief.schedule.start_deadline_s,
        stop=stop,
    )
    link.declare_live(keys.live(name, f"agent/{robot}"))
    first = loop.await_first_frame(stop)
    if first is None:
        return
    settle_memory()
    try:
        loop.run(first, stop)
    finally:
        rows.finish()
        counters = loop.counters
        values: dict[str, int | float | str] = {
            "ticks": counters.ticks,
            "bus_ns": counters.bus_ns,
            "listen_ns": counters.listen_ns,
            "compute_ns": counters.compute_ns,
            "undecodable": counters.undecodable,
            "stopped": agent.stopped_because,
        }
        report.put(Report(values).encode())


def main() -> int:
    """Serve as a controller; return the exit status."""
    return serve(AgentBrief, run, name="agent")


if __name__ == "__main__":
    raise SystemExit(main())
