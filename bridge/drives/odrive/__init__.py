"""ODrive CANSimple, firmware 0.6 layout: `ODRIVE` is its row of the drive protocols.

    frames                               layout of the messages, both ends'
    client, remote_axis, cadence         the controller's end, and its picture of each axis
    node, local_axis and those beside    the emulated axis on its bus
    section, model                       keys of [drive], and what an emulated axis makes of them
    decoder, formats, load, endpoint_file    what tools know of the protocol

Torques, speeds and positions in this folder are the shaft's, as the protocol has them, but where a
name says wheel.
"""

from bridge.drives.interface import DriveProtocol
from bridge.drives.odrive.client import OdriveClient
from bridge.drives.odrive.decoder import node_seen, words
from bridge.drives.odrive.endpoint_file import FlatEndpoints
from bridge.drives.odrive.formats import formats
from bridge.drives.odrive.load import cyclic_messages
from bridge.drives.odrive.model import AxisModel
from bridge.drives.odrive.node import OdriveNode
from bridge.drives.odrive.section import OdriveSection
from configs.brief import DriveModel


def emulated(model: DriveModel, node_id: int, serial_number: int) -> OdriveNode:
    """The emulated drive of one wheel."""
    return OdriveNode(AxisModel.of(model), node_id, serial_number)


ODRIVE = DriveProtocol(
    client=OdriveClient,
    node=emulated,
    cyclic_messages=cyclic_messages,
    words=words,
    node_seen=node_seen,
    section=OdriveSection,
    endpoints=FlatEndpoints(),
    formats=formats,
)
