"""A minimal drive protocol of a test's own: two messages per axis.

0x100 + node    drive → host     angle [1e-6 rev] and speed [1e-5 rev/s] of the shaft, i32
0x200 + node    host → drive     torque at the shaft, i16, in units of [drive]
"""

from support.second_drive.client import PlainClient
from support.second_drive.node import PlainNode
from support.second_drive.tools import PlainSection, cyclic_messages, node_seen, words

from bridge.drives.interface import DriveProtocol

ROW = DriveProtocol(
    client=PlainClient,
    node=PlainNode,
    cyclic_messages=cyclic_messages,
    words=words,
    node_seen=node_seen,
    section=PlainSection,
)
