r"""The slcan (LAWICEL) protocol, adapter's end: lines in, replies and frames out; no I/O.

    line         when             does                                    reply
    Sn, sxxyy    closed           nothing: the bus has its own bit rate   CR
    O            closed           opens                                   CR
    L            closed           opens, listening only                   CR
    C            any              closes                                  CR
    tiiin[dd]    open, not L      sends a frame with an 11-bit id         z CR
    Tiiiiiiiin   open, not L      ... with a 29-bit id                    Z CR
    riiin        open, not L      ... remote, 11-bit                      z CR
    Riiiiiiiin   open, not L      ... remote, 29-bit                      Z CR
    F            any              reads the status flags and clears them  Fhh CR
    Zn           any              time stamps of received frames on, off  CR
    V, v, N      any              hardware and firmware, detail, serial   text CR
    Mx, mx, Wn   any              nothing: the filters stay open          CR
    Un, Qn, X1   any              nothing                                 CR

Everything else, or at another time, is answered with BELL. Received frames are `t` `T` `r` `R`
lines with, on request, four hex digits of time [ms], modulo 60 000. Status flags: bit 3 data
overrun (frames were dropped without a reader), bit 7 bus error (an error frame was on the bus).
A line ends with CR; line feeds are ignored.

Where adapters differ this one is lenient: C while closed, Z while open, F while closed are all
right, and a remote frame may lack its length.
"""

import re
from typing import NamedTuple

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, RTR, Frame

OK, BELL = b"\r", b"\a"
VERSION, DETAIL, SERIAL = b"V0101\r", b"v0101\r", b"NFL01\r"
OVERRUN, BUS_ERROR = 0x08, 0x80
LONGEST_LINE = 64
_MINUTE_MS = 60_000
_FRAME = re.compile(
    rb"(?:(?P<short>[tr])(?P<id>[0-7][0-9A-Fa-f]{2})|(?P<wide>[TR])(?P<wide_id>[01][0-9A-Fa-f]{7}))"
    rb"(?P<length>[0-8])?(?P<data>[0-9A-Fa-f]*)"
)
_BIT_RATE = re.compile(rb"S[0-9]|s[0-9A-Fa-f]{4}")
_WITHOUT_EFFECT = re.compile(rb"[Mm][0-9A-Fa-f]{8}|W[0-2]|U[0-6]|Q[0-2]|X1")


class Answer(NamedTuple):
    """The result of some bytes."""

    reply: bytes
    frames: tuple[Frame, ...]


class Adapter:
    """One adapter; `process` what software writes, write to it what `show` returns."""

    __slots__ = ("_flags", "_line", "_listening", "_stamped", "opened")

    def __init__(self) -> None:
        self.opened = False
        self._listening = False
        self._stamped = False
        self._flags = 0
        self._line = bytearray()

    def process(self, data: bytes) -> Answer:
        """Process bytes, in any portions; return the answer to the lines that are complete."""
        reply = bytearray()
        frames: list[Frame] = []
        for byte in data:
            if byte == 0x0A:
                continue
            if byte != 0x0D:
                if len(self._line) <= LONGEST_LINE:
                    self._line.append(byte)
                continue
            line = bytes(self._line)
            self._line.clear()
            reply += self._obey(line, frames)
        return Answer(bytes(reply), tuple(frames))

    def show(self, frame: Frame, stamp_ns: int) -> bytes:
        """The line for a frame of the bus, empty if the software doesn't want it."""
        can_id, data = frame.can_id, frame.data
        if not self.opened:
            return b""
        if can_id & ERR:
            self._flags |= BUS_ERROR
            return b""
        remote = can_id & RTR
        letter = "r" if remote else "t"
        if can_id & EFF:
            head = f"{letter.upper()}{can_id & ID_MASK_29:08X}{len(data)}"
        else:
            head = f"{letter}{can_id & ID_MASK_11:03X}{len(data)}"
        body = "" if remote else data.hex().upper()
        stamp = f"{stamp_ns // 1_000_000 % _MINUTE_MS:04X}" if self._stamped else ""
        return f"{head}{body}{stamp}\r".encode()

    def overrun(self) -> None:
        """A frame was dropped on its way to the software."""
        self._flags |= OVERRUN

    def hang_up(self) -> None:
        """Close the channel, as after a C: no program holds the device any more."""
        self.opened = self._listening = self._stamped = False
        self._flags = 0
        self._line.clear()

    def _obey(self, line: bytes, frames: list[Frame]) -> bytes:
        match line:
            case b"":
                return OK
            case b"O" | b"L" if not self.opened:
                self.opened, self._listening = True, line == b"L"
                return OK
            case b"C":
                self.opened = self._listening = False
                return OK
            case b"F":
                flags, self._flags = self._flags, 0
                return f"F{flags:02X}\r".encode()
            case b"Z0" | b"Z1":
                self._stamped = line == b"Z1"
                return OK
            case b"V":
                return VERSION
            case b"v":
                return DETAIL
            case b"N":
                return SERIAL
        if _BIT_RATE.fullmatch(line):
            return BELL if self.opened else OK
        if _WITHOUT_EFFECT.fullmatch(line):
            return OK
        frame = parse(line)
        if frame is None or not self.opened or self._listening:
            return BELL
        frames.append(frame)
        return b"Z\r" if frame.can_id & EFF else b"z\r"


def parse(line: bytes) -> Frame | None:
    """The frame that a line without its CR means, None if it means none."""
    form = _FRAME.fullmatch(line)
    if form is None:
        return None
    wide = form["wide"] is not None
    can_id = int(form["wide_id"] if wide else form["id"], 16) | (EFF if wide else 0)
    length = int(form["length"] or 0)
    digits = form["data"]
    if (form["wide"] or form["short"]) in b"rR":
        return None if digits else Frame(can_id | RTR, bytes(length))
    if form["length"] is None or len(digits) != 2 * length:
        return None
    return Frame(can_id, bytes.fromhex(digits.decode()))
