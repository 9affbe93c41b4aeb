"""Which copies of the modules run: in Pythons of their own, as a process finds them once."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from configs.compiled import FOLDER, PURE, _Finder

ROOT = Path(__file__).parents[2]
WHICH = "import agents.guard, configs.compiled as c; print(agents.guard.__file__); print(c.how())"


def which(root: Path, **env: str) -> tuple[str, str]:
    """(file of a module that runs every tick, how it runs) of the sources in a folder."""
    inherited = {key: value for key, value in os.environ.items() if key != PURE}
    done = subprocess.run(
        [sys.executable, "-c", WHICH],
        cwd=root,
        env={**inherited, "PYTHONPATH": str(root), **env},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    file, how = done.stdout.splitlines()
    return file, how


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of the sources, beside which the compiled copies of this installation are found."""
    if which(ROOT)[1] != "compiled":
        pytest.skip(f"this installation: {which(ROOT)[1]}")
    for package in ("agents", "bridge", "configs", "fleetloop", "plant"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__py*"))
    return tmp_path


def copies(folder: Path) -> Path:
    """The compiled copies of this installation, copied into a folder that comes before it."""
    found = find_spec(FOLDER)
    assert found is not None
    assert found.submodule_search_locations is not None
    return shutil.copytree(next(iter(found.submodule_search_locations)), folder / FOLDER)


def test_compiled_copies_of_the_same_sources_run(sources: Path) -> None:
    file, how = which(sources)
    assert how == "compiled"
    assert file.endswith(".so")


def test_a_changed_source_is_never_shadowed_and_is_named(sources: Path) -> None:
    with (sources / "plant" / "motor.py").open("a") as source:
        source.write("# changed\n")
    assert which(sources) == (
        str(sources / "agents" / "guard.py"),
        "pure Python: plant/motor.py is not the one that was compiled;"
        " installing again compiles it",
    )


def test_a_source_that_is_gone_counts_as_changed(sources: Path) -> None:
    (sources / "agents" / "inputs.py").unlink()
    assert which(sources)[1].startswith("pure Python: agents/inputs.py is not the one")


def test_the_environment_chooses_the_sources(sources: Path) -> None:
    file, how = which(sources, **{PURE: "1"})
    assert how == f"pure Python: {PURE} is set"
    assert file.endswith("guard.py")
    assert which(sources, **{PURE: "0"})[1] == "compiled"


def test_copies_for_another_python_are_left_alone(sources: Path) -> None:
    manifest = copies(sources) / "manifest.json"
    said = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(said | {"python": "cpython-399"}))
    assert which(sources)[1] == "pure Python: compiled for cpython-399"


@pytest.mark.parametrize("text", [None, "{"])
def test_copies_without_a_manifest_are_left_alone(sources: Path, text: str | None) -> None:
    manifest = copies(sources) / "manifest.json"
    manifest.unlink()
    if text is not None:
        manifest.write_text(text)
    assert which(sources)[1].startswith(f"pure Python: {sources / FOLDER}: ")


def test_packages_of_others_with_our_names_get_none_of_them() -> None:
    finder = _Finder({"bridge.frame": Path("/copies/bridge.frame.so")})
    assert finder.find_spec("bridge.frame", ["/theirs/bridge"]) is None
    assert finder.find_spec("bridge.frames", [str(ROOT / "bridge")]) is None
    ours = finder.find_spec("bridge.frame", [str(ROOT / "bridge")])
    assert ours is not None
    assert ours.origin == "/copies/bridge.frame.so"
