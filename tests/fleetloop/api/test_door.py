"""`import fleetloop`: light until a name is used, refused where it would get others' packages."""

import subprocess
import sys
from pathlib import Path

import pytest

import fleetloop

HEAVY = ("numpy", "pydantic", "pandas", "matplotlib", "zenoh", "can", "typer", "configs", "bridge")


def python(code: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, cwd=cwd
    )


def test_the_import_alone_imports_nothing_else(tmp_path: Path) -> None:
    code = f"import sys, fleetloop; print([m for m in {HEAVY} if m in sys.modules])"
    assert python(code, tmp_path).stdout == "[]\n"


def test_a_run_needs_neither_matplotlib_nor_pandas(tmp_path: Path) -> None:
    code = (
        "import sys, fleetloop; fleetloop.run; fleetloop.Run;"
        " print([m for m in ('matplotlib', 'pandas', 'pyarrow', 'IPython') if m in sys.modules])"
    )
    assert python(code, tmp_path).stdout == "[]\n"


def test_every_name_is_there_and_listed() -> None:
    assert set(fleetloop.__all__) <= set(dir(fleetloop))
    for name in fleetloop.__all__:
        assert getattr(fleetloop, name) is not None
    assert fleetloop.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="'fleetloop' has no attribute 'lod'"):
        fleetloop.lod  # noqa: B018


def test_a_package_of_the_users_under_one_of_our_names_is_named(tmp_path: Path) -> None:
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "__init__.py").touch()
    done = python("import fleetloop; fleetloop.load", tmp_path)
    assert f"here 'configs' is {tmp_path / 'configs'}: rename that" in done.stderr


def test_a_folder_of_files_under_such_a_name_is_no_trouble(tmp_path: Path) -> None:
    (tmp_path / "configs").mkdir()
    done = python("import fleetloop; print(fleetloop.load('paper').name)", tmp_path)
    assert done.stdout == "paper\n"
