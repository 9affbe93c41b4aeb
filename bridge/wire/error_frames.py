"""Error frames that clients receive for events on the wire, as in Linux `can/error.h`.

    event                  class           data
    destroyed frame        0x08 protocol   [2] the violation, [3] where in the frame
    not acknowledged       0x20 no ACK
    its node's state       0x04 control    [1] warning, passive, or active again
    its node is bus-off    0x40
    its node is back       0x100

Byte 6 and 7 are the transmit and receive error counters of the client's own node, up to 255. A
client that has sent nothing has no node on the wire: for it they are 0.
"""

from bridge.frame import ERR, Frame
from bridge.wire.confinement import NodeState
from bridge.wire.node import ErrorFrame, ErrorKind, Node, StateChanged

CONTROLLER, PROTOCOL, NO_ACK, BUS_OFF, RESTARTED = 0x04, 0x08, 0x20, 0x40, 0x100
_RX_WARNING, _TX_WARNING, _RX_PASSIVE, _TX_PASSIVE, _ACTIVE = 0x04, 0x08, 0x10, 0x20, 0x40
_VIOLATION = {
    ErrorKind.BIT: (0x01, 0x00),
    ErrorKind.FORM: (0x02, 0x18),
    ErrorKind.STUFF: (0x04, 0x00),
}


def of_error(event: ErrorFrame, node: Node | None) -> Frame:
    """Error frame for a client at `node` after a destroyed frame; None: it has no node."""
    if event.kind is ErrorKind.ACK:
        return _frame(NO_ACK, node)
    kind, place = _VIOLATION[event.kind]
    return _frame(PROTOCOL, node, (0, 0, kind, place))


def of_state(event: StateChanged, before: NodeState) -> Frame:
    """Error frame for a client whose own node has changed its state."""
    node, state = event.node, event.state
    if state is NodeState.BUS_OFF:
        return _frame(BUS_OFF, node)
    if before is NodeState.BUS_OFF:
        return _frame(RESTARTED, node)
    sends = node.confinement.tec >= node.confinement.rec
    match state:
        case NodeState.ERROR_PASSIVE:
            status = _TX_PASSIVE if sends else _RX_PASSIVE
        case NodeState.ERROR_WARNING:
            status = _TX_WARNING if sends else _RX_WARNING
        case _:
            status = _ACTIVE
    return _frame(CONTROLLER, node, (0, status))


def _frame(kind: int, node: Node | None, details: tuple[int, ...] = ()) -> Frame:
    data = bytearray(8)
    data[: len(details)] = bytes(details)
    if node is not None:
        data[6], data[7] = min(node.confinement.tec, 255), min(node.confinement.rec, 255)
    return Frame(ERR | kind, bytes(data))
