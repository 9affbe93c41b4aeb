"""The content of an error frame as candump prints it (`candump -e`; Linux `can/error.h`).

identifier   bit mask of error classes
data         [0] bit of the lost arbitration, [1] controller, [2] kind of protocol violation,
[3] where in the frame, [6] and [7] transmit and receive error counters
"""

from collections.abc import Sequence

from bridge.frame import ERR, ID_MASK_29, MAX_DATA, Frame

COUNTERS = 0x200
CLASSES = (
    "tx-timeout",
    "lost-arbitration",
    "controller-problem",
    "protocol-violation",
    "transceiver-status",
    "no-acknowledgement-on-tx",
    "bus-off",
    "bus-error",
    "restarted-after-bus-off",
    "error-counter-tx-rx",
)
_CONTROLLER = (
    "rx-overflow",
    "tx-overflow",
    "rx-error-warning",
    "tx-error-warning",
    "rx-error-passive",
    "tx-error-passive",
    "back-to-error-active",
)
_VIOLATION = (
    "single-bit-error",
    "frame-format-error",
    "bit-stuffing-error",
    "tx-dominant-bit-error",
    "tx-recessive-bit-error",
    "bus-overload",
    "active-error",
    "error-on-tx",
)
_PLACES = {
    0x02: "id.28-to-id.21",
    0x03: "start-of-frame",
    0x04: "bit-srtr",
    0x05: "bit-ide",
    0x06: "id.20-to-id.18",
    0x07: "id.17-to-id.13",
    0x08: "crc-sequence",
    0x09: "reserved-bit-0",
    0x0A: "data-field",
    0x0B: "data-length-code",
    0x0C: "bit-rtr",
    0x0D: "reserved-bit-1",
    0x0E: "id.4-to-id.0",
    0x0F: "id.12-to-id.5",
    0x11: "active-error-flag",
    0x12: "intermission",
    0x13: "tolerate-dominant-bits",
    0x16: "passive-error-flag",
    0x17: "error-delimiter",
    0x18: "crc-delimiter",
    0x19: "acknowledge-slot",
    0x1A: "end-of-frame",
    0x1B: "acknowledge-delimiter",
    0x1C: "overload-flag",
}


def explain(frame: Frame) -> list[str]:
    """One line per error class of an error frame; none for any other frame."""
    if not frame.can_id & ERR:
        return []
    classes = frame.can_id & ID_MASK_29
    data = frame.data.ljust(MAX_DATA, b"\0")
    lines = [
        name + _details(1 << bit, data) for bit, name in enumerate(CLASSES) if classes & 1 << bit
    ]
    if not classes & COUNTERS and (data[6] or data[7]):
        lines.append(CLASSES[-1] + _details(COUNTERS, data))
    return lines


def _details(error_class: int, data: bytes) -> str:
    match error_class:
        case 0x002:
            return f"{{at bit {data[0]}}}"
        case 0x004:
            return f"{{{_names(data[1], _CONTROLLER)}}}"
        case 0x008:
            place = _PLACES.get(data[3], "unspecified" if 0 < data[3] < 0x20 else "")
            return f"{{{{{_names(data[2], _VIOLATION)}}}{{{place}}}}}"
        case 0x200:
            return f"{{{{{data[6]}}}{{{data[7]}}}}}"
    return ""


def _names(bits: int, names: Sequence[str]) -> str:
    return ",".join(name for bit, name in enumerate(names) if bits & 1 << bit)
