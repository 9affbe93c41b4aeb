"""Build hook of hatch: compiled copies of the modules that run every tick, beside their sources.

mypyc makes C of them, the machine's C compiler one library; the wheel has them in a folder
`fleetloop_compiled`, where `configs.compiled` finds them. Without a compiler, or when anything goes
wrong, the wheel is a pure one, and one line says why. `FLEETLOOP_PURE=1` builds a pure one.

    python packaging/compile_hook.py FOLDER MODULE...       what the hook runs: into a folder
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import Any

FOLDER = "fleetloop_compiled"
PURE = "FLEETLOOP_PURE"
LONGEST_S = 900.0
"""Of compiling."""
# Doubles as CPython has them: no fused multiply-add, nothing reordered. Calls from one file to
# another and to Python's library are direct, without a stub of the linker: a tenth of a tick.
_C_FLAGS = (
    *("-O1", "-ffp-contract=off", "-fno-fast-math"),
    *("-fvisibility=hidden", "-fno-plt"),
    *("-g0", "-w"),
)
_UNITS = 3
"""For each processor."""
# The dependencies, and with them their types, are missing here: what mypy finds wrong isn't.
_MYPY = """\
[mypy]
python_version = 3.11
ignore_missing_imports = True
ignore_errors = True
[mypy-fleetloop]
follow_imports = skip
"""

with suppress(ImportError):  # where this runs as a program, hatchling isn't needed
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface

    class CompileHook(BuildHookInterface):  # type: ignore[type-arg]
        """Adds the compiled copies to a wheel."""

        PLUGIN_NAME = "custom"

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            """Compile, before the wheel is packed."""
            self._scratch = Path(tempfile.mkdtemp(prefix="fleetloop-build-"))
            why_not = _compile_apart(Path(self.root), self._scratch, self.config["modules"])
            if why_not:
                self.app.display_warning(f"fleetloop: installed as pure Python: {why_not}")
                return
            files = {str(path): f"{FOLDER}/{path.name}" for path in _products(self._scratch)}
            kind = "force_include_editable" if version == "editable" else "force_include"
            build_data[kind].update(files)
            build_data["pure_python"], build_data["infer_tag"] = False, True

        def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
            """Remove what compiling left."""
            shutil.rmtree(self._scratch, ignore_errors=True)


def _products(scratch: Path) -> list[Path]:
    return sorted((scratch / FOLDER).iterdir())


def _compile_apart(root: Path, scratch: Path, modules: Sequence[str]) -> str:
    """Compile in a process of its own; why it failed, "" if it didn't."""
    if os.environ.get(PURE, "") not in ("", "0"):
        return f"{PURE} is set"
    command = [sys.executable, str(Path(__file__).absolute()), str(scratch), *modules]
    try:
        done = subprocess.run(
            command, cwd=root, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if done.returncode == 0:
        return ""
    said = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    errors = [line for line in said if "error" in line.lower()] or said
    return errors[-1].strip() if errors else f"exit status {done.returncode}"


def compile_modules(modules: Sequence[str], scratch: Path) -> None:
    """Compile modules, by their paths from here, into a folder in a folder for scratch files.

    Raises:
        Exception: mypyc or the C compiler fails.
        SystemExit: mypyc refuses a module; it has said why.
    """
    from mypyc.build import mypycify
    from setuptools import Distribution, Extension
    from setuptools.command.build_ext import build_ext

    class Build(build_ext):
        """Compiles the C files of an extension side by side."""

        def build_extension(self, extension: Extension) -> None:
            compile_one = self.compiler.compile

            def side_by_side(sources: Sequence[str], **options: Any) -> list[str]:
                units = _units(sources, Path(self.build_temp))
                with ThreadPoolExecutor(os.cpu_count()) as pool:
                    objects = pool.map(lambda one: compile_one([one], **options), units)
                    return [name for names in objects for name in names]

            self.compiler.compile = side_by_side
            try:
                super().build_extension(extension)
            finally:
                self.compiler.compile = compile_one

    def build(extensions: Sequence[Extension]) -> None:
        command = Build(Distribution({"name": "fleetloop", "ext_modules": list(extensions)}))
        command.build_lib, command.build_temp = str(scratch / "lib"), str(scratch / "temp")
        command.ensure_finalized()
        command.run()

    # First, for seconds: whether there is a compiler with Python's headers.
    scratch.mkdir(parents=True, exist_ok=True)
    probe = scratch / "probe.c"
    probe.write_text("#include <Python.h>\nPyMODINIT_FUNC PyInit_probe(void) { return NULL; }\n")
    build([Extension("probe", [str(probe)])])
    config = scratch / "mypy.ini"
    config.write_text(_MYPY)
    extensions = mypycify(
        ["--config-file", str(config), "--cache-dir", str(scratch / "mypy"), *modules],
        opt_level="1",
        debug_level="0",
        multi_file=True,
        target_dir=str(scratch / "c"),
        group_name="fleetloop",
    )
    for extension in extensions:
        extension.extra_compile_args = [*extension.extra_compile_args, *_C_FLAGS]
    build(extensions)
    out = scratch / FOLDER
    out.mkdir()
    libraries = {}
    for library in (scratch / "lib").rglob("*.so"):
        package = library.relative_to(scratch / "lib").parent.parts
        name = ".".join((*package, library.name.partition(".")[0]))
        if name != "probe":
            libraries[name] = f"{name}.so"
            library.rename(out / f"{name}.so")
    sources = {one: blake2b(Path(one).read_bytes(), digest_size=16).hexdigest() for one in modules}
    manifest = {"python": sys.implementation.cache_tag, "sources": sources, "libraries": libraries}
    (out / "manifest.json").write_text(json.dumps(manifest, indent=1))


def _units(sources: Sequence[str], folder: Path) -> list[str]:
    """Files that include several of these: the headers of all take long to read.

    A few for each processor, of about the same size.
    """
    count = _UNITS * (os.cpu_count() or 1)
    if len(sources) <= count:
        return list(sources)
    units: list[list[str]] = [[] for _ in range(count)]
    sizes = [0] * count
    for source in sorted(sources, key=lambda one: -Path(one).stat().st_size):
        least = sizes.index(min(sizes))
        units[least].append(source)
        sizes[least] += Path(source).stat().st_size
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, unit in enumerate(units):
        path = folder / f"unit_{number}.c"
        path.write_text("".join(f'#include "{Path(one).absolute()}"\n' for one in unit))
        paths.append(str(path))
    return paths


if __name__ == "__main__":
    compile_modules(sys.argv[2:], Path(sys.argv[1]))
