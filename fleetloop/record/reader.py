"""Read a record into numpy arrays, complete or cut."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from mcap import records

from configs.errors import ScenarioError
from fleetloop.record import schema
from fleetloop.record.mcap_file import SCENARIO
from fleetloop.record.scan import scan
from fleetloop.record.schema import Kind


@dataclass(frozen=True, slots=True)
class Record:
    """A run's record: per robot and source a structured array, one element per tick.

    Fields are `tick` and the signals of `configs.signals` by name.
    """

    path: Path
    robots: tuple[str, ...]
    plant: dict[str, np.ndarray]
    controller: dict[str, np.ndarray]
    scenario_toml: str
    complete: bool  # the file has its end

    @classmethod
    def open(cls, path: Path) -> "Record":
        """Read a record file.

        Raises:
            ScenarioError: it is no record.
        """
        found = scan(path)
        robots = _robots(found.channels)
        if not robots:
            raise ScenarioError(f"{path}: an MCAP file, but not the record of a run")
        blocks: dict[tuple[int, Kind], list[np.ndarray]] = {}
        decompress = zstandard.ZstdDecompressor().decompress
        with path.open("rb") as stream:
            for index, channel, _ in found.chunks:
                kind = schema.kind_of(channel)
                if kind is Kind.POSE:
                    continue
                stream.seek(index.chunk_start_offset + index.chunk_length - index.compressed_size)
                body = decompress(
                    stream.read(index.compressed_size), max_output_size=index.uncompressed_size
                )
                messages = np.frombuffer(body, schema.MESSAGE_TYPES[kind])
                number = schema.robot_number_of(channel)
                blocks.setdefault((number, kind), []).append(messages["payload"])

        def rows(kind: Kind) -> dict[str, np.ndarray]:
            empty = np.empty(0, schema.ROW_TYPES[kind])
            return {
                robot: np.concatenate([empty, *blocks.get((number, kind), [])])
                for number, robot in enumerate(robots)
            }

        texts = [a.data.decode() for a, _ in found.attachments if a.name == SCENARIO]
        return cls(
            path, robots, rows(Kind.PLANT), rows(Kind.CONTROLLER), "".join(texts), found.complete
        )


def _robots(channels: list[records.Channel]) -> tuple[str, ...]:
    in_order = sorted(channels, key=lambda channel: channel.id)
    parts = [channel.topic.split("/") for channel in in_order]
    return tuple(
        part[1] for part in parts if len(part) == 3 and part[0] == "robot" and part[2] == "plant"
    )
