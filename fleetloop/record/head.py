"""The head of a record: its robots, its layout and its scenario.

    magic, Header, Schema (7 or more), Channel (7, and 3 per robot), Attachment scenario.toml,
    Metadata fleetloop

The metadata say which version wrote the record, and CRC-32 of every byte before them: MCAP itself
has no check of channels and schemas that holds for a file whose end is missing.
"""

import struct
import zlib
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from io import BytesIO
from typing import Any, NamedTuple, Protocol, TypeVar

from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from fleetloop.record import schema
from fleetloop.record.schema import SIGNALS, Layout

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "fleetloop"
SCENARIO = "scenario.toml"
_VERSION, _CRC = "version", "crc32_of_all_before"
PREFIX = struct.Struct("<BQ")
"""Prefix of every MCAP record: its opcode and the length of its content."""
_Records = Sequence[tuple[int, bytes]]


class _Readable(Protocol):
    """A kind of MCAP record; `McapRecord` itself has no `read`."""

    @staticmethod
    def read(stream: ReadDataStream) -> Any: ...


_Kind = TypeVar("_Kind", bound=_Readable)


class Head(NamedTuple):
    """The head of a record, as its bytes and as what the summary repeats of it."""

    data: bytes
    layout: Layout
    scenario_toml: str
    schemas: tuple[records.Schema, ...]
    channels: tuple[records.Channel, ...]
    attachment: records.AttachmentIndex
    metadata: records.MetadataIndex


class HeadError(Exception):
    """It isn't the head of a record; the text says why."""


def build(layout: Layout, scenario_toml: str) -> Head:
    """The head of a new record."""
    schemas = tuple(
        records.Schema(id=number, name=name, encoding="ros2msg", data=text.encode())
        for number, name, text in layout.schemas()
    )
    channels = tuple(
        records.Channel(
            id=channel,
            schema_id=layout.schema_number(channel),
            topic=layout.topic(channel),
            message_encoding="cdr",
            metadata=layout.metadata(channel),
        )
        for channel in layout.channels
    )
    data = MAGIC + b"".join(
        map(encoded, (records.Header(profile="ros2", library=LIBRARY), *schemas, *channels))
    )
    attachment = records.Attachment(
        create_time=0,
        log_time=0,
        name=SCENARIO,
        media_type="application/toml",
        data=scenario_toml.encode(),
    )
    attached = encoded(attachment)
    attachment_index = records.AttachmentIndex(
        offset=len(data),
        length=len(attached),
        log_time=0,
        create_time=0,
        data_size=len(attachment.data),
        name=SCENARIO,
        media_type=attachment.media_type,
    )
    data += attached
    facts = {_VERSION: _version(), _CRC: f"{zlib.crc32(data):08x}"}
    said = encoded(records.Metadata(LIBRARY, facts))
    metadata_index = records.MetadataIndex(len(data), len(said), LIBRARY)
    return Head(
        data + said,
        layout,
        scenario_toml,
        schemas,
        channels,
        attachment_index,
        metadata_index,
    )


@cache
def _version() -> str:
    return metadata.version("fleetloop")


def understood(found: _Records, crc: int) -> Head:
    """The head that a file begins with.

    Args:
        found: its records as opcode and content, the metadata last.
        crc: CRC-32 of the bytes before the metadata.

    Raises:
        HeadError: it is damaged, of something else, or of a version with other signals.
    """
    try:
        header = next(iter(_all_of(records.Header, Opcode.HEADER, found)), None)
        if header is None or header.library != LIBRARY:
            who = f", but of {header.library!r}" if header is not None else ""
            raise HeadError(f"an MCAP file, but not the record of a run{who}")
        said = next(iter(_all_of(records.Metadata, Opcode.METADATA, found)), None)
        if said is None or _CRC not in said.metadata:
            raise HeadError("of another version of Fleetloop, or damaged: no check sum of its head")
        if said.metadata[_CRC] != f"{crc:08x}":
            raise HeadError("damaged: the check sum of its head differs")
        (attachment,) = _all_of(records.Attachment, Opcode.ATTACHMENT, found)
        head = build(_layout(found), attachment.data.decode())
    except (McapError, ValueError, LookupError, struct.error) as error:
        raise HeadError(f"damaged: its head says nothing ({str(error) or 'too short'})") from error
    if list(found[:-1]) != _parts(head):
        writer = said.metadata.get(_VERSION, "?")
        theirs = _signals(_all_of(records.Schema, Opcode.SCHEMA, found))
        ours = _signals(head.schemas)
        differ = ", ".join(sorted(theirs ^ ours)) or "none"
        raise HeadError(
            f"written by Fleetloop {writer} in another layout than that of this one,"
            f" {_version()}; signals that only one of both has: {differ}"
        )
    return head


def _all_of(kind: type[_Kind], opcode: Opcode, found: _Records) -> list[_Kind]:
    return [
        kind.read(ReadDataStream(BytesIO(content))) for number, content in found if number == opcode
    ]


def _layout(found: _Records) -> Layout:
    """Robots and tables; without names in the metadata, of another version, no table."""
    texts = {one.id: one.data.decode() for one in _all_of(records.Schema, Opcode.SCHEMA, found)}
    robots = {
        channel.topic.split("/")[1]: schema.signals_of(
            channel.metadata[SIGNALS], texts[channel.schema_id]
        )
        if SIGNALS in channel.metadata
        else ()
        for channel in _all_of(records.Channel, Opcode.CHANNEL, found)
        if channel.topic.endswith("/controller")
    }
    return Layout.of(robots)


def _parts(head: Head) -> list[tuple[int, bytes]]:
    """Its records before the metadata, as opcode and content."""
    parts, at = [], len(MAGIC)
    while at < head.metadata.offset:
        opcode, length = PREFIX.unpack_from(head.data, at)
        at += PREFIX.size
        parts.append((opcode, head.data[at : at + length]))
        at += length
    return parts


def _signals(schemas: Sequence[records.Schema]) -> set[str]:
    """Names of the fields of all rows."""
    lines = [
        line for schema in schemas for line in schema.data.decode(errors="replace").split("\n")
    ]
    return {line.split()[1] for line in lines if line.startswith("float64 ")}


def encoded(record: records.McapRecord) -> bytes:
    """A record's bytes."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
