"""Whether the modules that run every tick run compiled.

An installation may have compiled copies of them, made of these sources by mypyc: a folder
`fleetloop_compiled`, with a manifest of what each was made of. They are taken in place of the
sources if all of those are still the same, and else none is: compiled modules call each other
without asking whether there is something newer. `FLEETLOOP_PURE=1` takes the sources.

The packages whose modules are compiled import this one first.
"""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

FOLDER = "fleetloop_compiled"
PURE = "FLEETLOOP_PURE"
_ROOT = Path(__file__).parent.parent


class _Finder:
    """Finds the compiled copies, by module."""

    def __init__(self, libraries: Mapping[str, Path]) -> None:
        self._libraries = libraries

    def find_spec(
        self, name: str, path: Sequence[str] | None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        library = self._libraries.get(name)
        if library is None or (path is not None and not self._is_ours(path)):
            return None
        return spec_from_file_location(name, library)

    @staticmethod
    def _is_ours(path: Sequence[str]) -> bool:
        """Whether a package is; a program may have others of these names beside ours."""
        return any(Path(place).is_relative_to(_ROOT) for place in path)


def _install() -> str:
    """Let the compiled copies be found, if they are good; else why they are not taken."""
    if os.environ.get(PURE, "") not in ("", "0"):
        return f"{PURE} is set"
    found = find_spec(FOLDER)
    places = list(found.submodule_search_locations or ()) if found is not None else []
    if not places:
        return "not compiled when it was installed"
    folder = Path(places[0])
    try:
        manifest = json.loads((folder / "manifest.json").read_bytes())
    except (OSError, ValueError) as error:
        return f"{folder}: {error}"
    if manifest["python"] != sys.implementation.cache_tag:
        return f"compiled for {manifest['python']}"
    for source, made_of in manifest["sources"].items():
        if _digest(_ROOT / source) != made_of:
            return f"{source} is not the one that was compiled; installing again compiles it"
    libraries = {name: folder / library for name, library in manifest["libraries"].items()}
    sys.meta_path.insert(0, _Finder(libraries))
    return ""


def _digest(source: Path) -> str:
    try:
        return blake2b(source.read_bytes(), digest_size=16).hexdigest()
    except OSError:
        return ""


WHY_PURE = _install()
"""Why the sources run; "" where the compiled copies do."""


def how() -> str:
    """In words: compiled, or pure Python and why."""
    return f"pure Python: {WHY_PURE}" if WHY_PURE else "compiled"
