"""ODrive CANSimple, firmware 0.6 layout: `ODRIVE` is its row of the drive protocols.

    frames                               layout of the messages, both ends'
    client, remote_axis, cadence         the controller's end, and its picture of each axis
    node, local_axis and those beside    the emulated axis on its bus
    decoder, load, endpoint_file         what tools know of the protocol

Torques, speeds and positions in this folder are the shaft's, as the protocol has them, but where a
name says wheel.
"""

from bridge.drives.interface import DriveProtocol
from bridge.drives.odrive.client import OdriveClient
from bridge.drives.odrive.decoder import node_seen, words
from bridge.drives.odrive.endpoint_file import FlatEndpoints
from bridge.drives.odrive.load import cyclic_messages
from bridge.drives.odrive.node import OdriveNode

ODRIVE = DriveProtocol(
    client=OdriveClient,
    node=OdriveNode,
    cyclic_messages=cyclic_messages,
    words=words,
    node_seen=node_seen,
    endpoints=FlatEndpoints(),
)
