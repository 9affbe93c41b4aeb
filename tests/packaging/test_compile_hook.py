"""The build hook: what it compiles, and what it says where it can't."""

import ast
import importlib.util
import json
import shutil
import sys
import tomllib
from hashlib import blake2b
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
SMALL = "agents/laws/path_errors.py"


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("hook", ROOT / "packaging" / "compile_hook.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.delenv(module.PURE, raising=False)
    return module


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_a_module_becomes_a_library_and_an_entry_of_the_manifest(
    hook: ModuleType, tmp_path: Path
) -> None:
    assert hook._compile_apart(ROOT, tmp_path, [SMALL]) == ""
    folder = tmp_path / hook.FOLDER
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["python"] == sys.implementation.cache_tag
    digest = blake2b((ROOT / SMALL).read_bytes(), digest_size=16).hexdigest()
    assert manifest["sources"] == {SMALL: digest}
    assert "agents.laws.path_errors" in manifest["libraries"]
    assert {*manifest["libraries"].values(), "manifest.json"} == {
        path.name for path in hook._products(tmp_path)
    }


def test_without_a_compiler_it_says_so_before_it_begins(
    hook: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "/no/such/compiler")
    assert "/no/such/compiler" in hook._compile_apart(ROOT, tmp_path, [SMALL])
    assert not (tmp_path / "c").exists()


def test_what_mypyc_refuses_is_the_reason(hook: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "nested.py").write_text("class A:\n    class B:\n        pass\n")
    why = hook._compile_apart(tmp_path, tmp_path / "scratch", ["nested.py"])
    assert why.startswith("nested.py:2: error: ")


def test_the_environment_asks_for_a_pure_one(
    hook: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(hook.PURE, "1")
    assert hook._compile_apart(ROOT, tmp_path, [SMALL]) == f"{hook.PURE} is set"


def test_the_base_of_a_compiled_class_is_compiled_or_pythons_own() -> None:
    """A class from elsewhere has a layout that mypyc doesn't know: making one would be a crash."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    wheel = config["tool"]["hatch"]["build"]["targets"]["wheel"]
    classes = [
        node
        for module in wheel["hooks"]["custom"]["modules"]
        for node in ast.walk(ast.parse((ROOT / module).read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    ]
    pythons = {
        "ABC",
        "Enum",
        "Exception",
        "Generic",
        "IntEnum",
        "IntFlag",
        "NamedTuple",
        "Protocol",
        "ValueError",
    }
    known = {node.name for node in classes} | pythons | {"Law", "StrEnum"}
    bases = {
        ast.unparse(base.value if isinstance(base, ast.Subscript) else base): node.name
        for node in classes
        for base in node.bases
    }
    assert {base: name for base, name in bases.items() if base not in known} == {}
