"""The files of docs/own-laws.md: a law, a path shape, an offset and their scenario."""

import tomllib
from pathlib import Path

import tomli_w
from support.snippets import HOME, snippets

FILES = ("my_law.py", "my_analysed_law.py", "my_shapes.py", "own.toml")


def write_own_files(folder: Path) -> None:
    """Write the files of the page into a folder, as they are printed."""
    for name in FILES:
        (text,) = (s.text for s in snippets("python", "toml") if s.text.startswith(f"# {name}\n"))
        (folder / name).write_text(text)


def write_own_at_100_hz(folder: Path) -> Path:
    """Write the law, and a scenario in real time in which both robots have it; return that."""
    write_own_files(folder)
    data = tomllib.loads((HOME / "configs/two_robots_100hz.toml").read_text())
    data |= {"control": {"law": "my_law:Unicycle"}, "expect": []}
    file = folder / "own_100hz.toml"
    file.write_text(tomli_w.dumps(data))
    return file


def replaced(folder: Path, name: str, old: str, new: str) -> None:
    """Change the first occurrence of a text in one of the files."""
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new, 1))
