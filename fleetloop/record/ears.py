"""Where the recorder hears each source of a run: on a socket, or over the network.

Processes on this machine have a socket each (`bridge.network.row_socket`); on other machines, and
where an operator started them, they are heard over the network.
"""

import socket
from itertools import chain

from bridge.network import keys
from bridge.network.link import Link
from bridge.network.row_socket import RowSockets
from configs.brief import RecorderBrief
from configs.roles import AGENT, PLANT

ROOM_BYTES = 1 << 26
"""Of what waits of one source on the network: a slow disk may take its time."""
_KEYS = {
    "plant": keys.truth,
    "controller": keys.telemetry,
    "can": keys.traffic,
    "inputs": keys.inputs,
}


def open_ears(brief: RecorderBrief, link: Link) -> RowSockets:
    """Where the blocks of all processes of a run arrive."""
    here = _sources(brief)
    elsewhere = [here.pop(process) for process in brief.elsewhere]
    run = brief.network.run
    for tag in chain.from_iterable(elsewhere):
        kind, _, name = tag.partition("/")
        link.subscribe(_KEYS[kind](run, name), tag, room_bytes=ROOM_BYTES)
    return RowSockets(socket.socket(fileno=brief.sockets), here, link if elsewhere else None)


def _sources(brief: RecorderBrief) -> dict[str, list[str]]:
    """The tags of the blocks that each process has; an input log is heard once its rows are."""
    sources = {}
    for robot in brief.robots:
        inputs = [f"inputs/{robot}"] if brief.logged_inputs else []
        sources[AGENT.process(robot)] = [*inputs, f"controller/{robot}"]
    truths = [f"plant/{robot}" for robot in brief.robots]
    return sources | {PLANT.name: [*truths, *(f"can/{bus}" for bus in brief.buses)]}
