"""Our packages among others of the same names: `agents`, `bridge`, `configs` and `plant` are words.

A user's project may have folders of these names where Python looks first. Our own programs put such
places last. In a user's program, which opens a bus through python-can, our modules are loaded
beside the user's: `import configs` there is the user's, before and afterwards.

Imports nothing of ours.
"""

import importlib
import importlib.util
import os
import sys
from collections.abc import Collection, Sequence
from pathlib import Path
from types import ModuleType

NAMES = ("agents", "bridge", "configs", "plant")
HOME = Path(__file__).resolve().parent.parent
_OF_CLIENTS = ("configs", "bridge")  # in the order of their imports


def prefer_own() -> None:
    """In a program of ours: look for packages in other places of such names last."""
    sys.path.sort(key=_shadows)


def environment() -> dict[str, str]:
    """The environment for a program of ours, without such places."""
    variables = dict(os.environ)
    if path := variables.get("PYTHONPATH"):
        entries = [entry for entry in path.split(os.pathsep) if not _shadows(entry)]
        variables["PYTHONPATH"] = os.pathsep.join(entries)
    return variables


def load_own(module: str, *later: str) -> ModuleType:
    """A client's module of ours, whatever the program has under the names of our packages.

    `later` are modules that it imports when it needs them: if others have our names, they are
    loaded at once, while ours can be found.
    """
    foreign = [name for name in _OF_CLIENTS if _folders(name) != [HOME / name]]
    if not foreign:
        return importlib.import_module(module)
    places = {name: _folders(name) for name in foreign}
    theirs = {name: sys.modules.pop(name) for name in _loaded(foreign)}
    try:
        for name in foreign:
            _place(name)
        for name in (module, *later):
            importlib.import_module(name)
        return sys.modules[module]
    finally:
        for name in _loaded(foreign):
            package, _, rest = name.partition(".")
            if not rest or _has(places[package], rest):
                del sys.modules[name]
        sys.modules.update(theirs)


def refuse_others() -> None:
    """Refuse a program that has packages of others under our names: it would get theirs.

    Raises:
        ImportError: it names the package, and where it is.
    """
    for name in NAMES:
        folders = _folders(name)
        if folders != [HOME / name]:
            where = folders[0] if folders else "a module without a folder"
            raise ImportError(
                f"fleetloop has a package {name!r} of its own, but here {name!r} is {where}:"
                " rename that, or run from another folder (python -P)",
                name=name,
            )


def _shadows(entry: str) -> bool:
    """Whether a place on the path, other than ours, has a package or module of our names."""
    place = Path(entry).resolve()  # "" is the current folder
    return place != HOME and any(_has([place], name) for name in NAMES)


def _has(places: Sequence[Path], module: str) -> bool:
    """Whether one of these folders has a module of that name."""
    path = Path(*module.split("."))
    return any(
        (place / path / "__init__.py").exists() or (place / path).with_suffix(".py").exists()
        for place in places
    )


def _loaded(packages: Collection[str]) -> list[str]:
    """Names of the loaded modules of these packages."""
    return [name for name in sys.modules if name.partition(".")[0] in packages]


def _folders(package: str) -> list[Path]:
    """Where this program finds the modules of a package; nowhere if it is none."""
    if (module := sys.modules.get(package)) is not None:
        found = getattr(module, "__path__", [])
    else:
        spec = importlib.util.find_spec(package)
        found = (spec.submodule_search_locations if spec is not None else None) or []
    return [Path(folder).resolve() for folder in found]


def _place(name: str) -> None:
    """Load a package of ours under its name."""
    file = HOME / name / "__init__.py"
    spec = importlib.util.spec_from_file_location(
        name, file, submodule_search_locations=[str(file.parent)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"Fleetloop's own package {name!r} is not at {file}", name=name)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
