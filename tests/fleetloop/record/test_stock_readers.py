"""Readers that others wrote are content with a whole record: the programs of docs/records.md."""

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from support.snippets import snippets

PACKAGES = (
    "@mcap/core",
    "@mcap/support",
    "@foxglove/rosmsg",
    "@foxglove/rosmsg2-serialization",
)


def program(folder: Path, name: str) -> Path:
    """A program of docs/records.md as a file."""
    (text,) = (it.text for it in snippets("python", "js") if f"{name}\n" in it.text[:40])
    (folder / name).write_text(text, "utf-8")
    return folder / name


def said(*command: str | Path, env: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout


def counted(record: Path) -> dict[str, int]:
    """Messages by topic, each decoded, check sums on."""
    counts: Counter[str] = Counter()
    with record.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, *_ in reader.iter_decoded_messages():
            counts[channel.topic] += 1
        summary = reader.get_summary()
    assert summary is not None
    statistics = summary.statistics
    assert {
        summary.channels[number].topic: count
        for number, count in statistics.channel_message_counts.items()
    } == counts
    return dict(counts)


def test_every_message_of_a_record_is_decoded_in_python(finished_run: Path) -> None:
    counts = counted(finished_run / "record.mcap")
    rows = {f"robot/{r}/{kind}": 2000 for r in ("r1", "r2") for kind in ("plant", "controller")}
    poses = {f"robot/{r}/pose": 200 for r in ("r1", "r2")}
    scenes = dict.fromkeys(("scene/robots", "scene/references", "scene/edges", "tf", "fleet"), 80)
    assert counts == rows | poses | scenes | {"scene/paths": 1, "log": 2}


def test_the_programs_in_python_print_what_is_in_it(finished_run: Path, tmp_path: Path) -> None:
    record = finished_run / "record.mcap"
    first, second = said(sys.executable, program(tmp_path, "rows.py"), record).splitlines()
    assert first.startswith("r1 3.998 ")
    assert second.startswith("r2 3.998 ")
    lines = said(sys.executable, program(tmp_path, "messages.py"), record).splitlines()
    assert len(lines) == 80 + 2
    assert lines[0].startswith("0.0 ")


def test_every_message_of_a_record_is_decoded_in_javascript(
    finished_run: Path, tmp_path: Path
) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node isn't here")
    beside = Path(node).resolve().parents[1] / "lib" / "node_modules"  # npm install --global
    places = os.pathsep.join(filter(None, (os.environ.get("NODE_PATH"), str(beside))))
    env = {**os.environ, "NODE_PATH": places}
    wanted = "".join(f"require.resolve('{name}');" for name in PACKAGES)
    if subprocess.run([node, "-e", wanted], env=env, capture_output=True, timeout=60).returncode:
        pytest.skip(f"node finds no {', '.join(PACKAGES)}")
    record = finished_run / "record.mcap"
    counts = json.loads(said(node, program(tmp_path, "read.cjs"), record, env=env))
    assert counts == counted(record)
    hurt = bytearray(record.read_bytes())
    hurt[len(hurt) // 2] ^= 1
    (tmp_path / "hurt.mcap").write_bytes(hurt)
    with pytest.raises(AssertionError, match=r"(?i)crc|corrupt|zstd"):
        said(node, program(tmp_path, "read.cjs"), tmp_path / "hurt.mcap", env=env)
