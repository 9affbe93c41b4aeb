"""Laws, path shapes, formation offsets and drive protocols by name: shipped, installed, or own.

    adaptive_dsc      shipped: a row of the tables below
    lqr               an entry point of the group, from an installed package
    my_law:MyLaw      class MyLaw of my_law.py beside the scenario file, else on sys.path

A file beside the scenario is loaded by its path, under a name of its own, and its folder is put at
the end of sys.path for what it imports: it hides no module of anything else. Processes get a
`Plugin`, which says where the class is, and import it themselves.
"""

import importlib
import importlib.util
import pickle
import sys
import traceback
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from configs.drives import Drive
from configs.errors import ScenarioError
from configs.parameters import Parameters
from configs.shapes import OwnOffset, OwnPath
from configs.signals import signals_fault
from configs.wording import guess

LAWS = {
    "adaptive_dsc": "agents.laws.adaptive_dsc:AdaptiveDsc",
    "adaptive_dsc_robust": "agents.laws.adaptive_dsc_robust:AdaptiveDscRobust",
    "fixed_dsc": "agents.laws.fixed_dsc:FixedDsc",
    "backstepping_analytic": "agents.laws.backstepping_analytic:BacksteppingAnalytic",
    "backstepping_numeric": "agents.laws.backstepping_numeric:BacksteppingNumeric",
}
"""The laws that are shipped: class by name."""


class Kind(Enum):
    """Kind of a plug-in; the value is its word in messages and its entry point group."""

    LAW = "law", "fleetloop.laws"
    PATH = "path shape", "fleetloop.paths"
    OFFSET = "formation offset", "fleetloop.offsets"
    DRIVE = "drive protocol", "fleetloop.drives"

    @property
    def word(self) -> str:
        """For people."""
        return self.value[0]

    @property
    def group(self) -> str:
        """Of entry points."""
        return self.value[1]

    @property
    def form(self) -> str:
        """The name of one's own in a file."""
        return "module:ROW" if self is Kind.DRIVE else "module:Class"


class PluginError(ScenarioError):
    """A name of a file leads to no usable class; the text says why, without the name."""


@dataclass(frozen=True, slots=True)
class Plugin:
    """Where a class is."""

    kind: Kind
    name: str  # as in the file
    target: str  # "module:Class"
    folder: str = ""  # where the module is looked for first; "" is nowhere


def find(
    kind: Kind,
    name: str,
    folder: str,
    shipped: Mapping[str, str],
    *,
    place: str = "beside the scenario",
) -> Plugin:
    """Where a name leads; `place` is the folder in words.

    Raises:
        PluginError: nowhere.
    """
    if name in shipped:
        return Plugin(kind, name, shipped[name])
    if name.partition(":")[0].endswith(".py"):
        raise PluginError(
            f'must be "{_module_form(name, kind)}", a module {place}, not the path of a file'
        )
    if ":" in name:
        return Plugin(kind, name, name, folder)
    installed = entry_points(kind)
    if name in installed:
        return Plugin(kind, name, installed[name])
    if other := _other_kind(kind, name):
        raise PluginError(f"is a {other.word}, no {kind.word}")
    known = sorted({*shipped, *installed})
    raise PluginError(
        f"no such {kind.word}{guess(name, known)} (known: {', '.join(known)}; one of your own is"
        f' "{kind.form}", from module.py {place})'
    )


def _module_form(name: str, kind: Kind) -> str:
    """The name of a class whose file is given."""
    file, _, path = name.partition(":")
    return f"{Path(file).stem}:{path or kind.form.partition(':')[2]}"


def _other_kind(kind: Kind, name: str) -> Kind | None:
    """The kind of an installed plug-in that has this name, if it is another one."""
    return next((one for one in Kind if one is not kind and name in entry_points(one)), None)


def entry_points(kind: Kind) -> dict[str, str]:
    """Plug-ins of installed packages: class by name."""
    from importlib import metadata

    return {point.name: point.value for point in metadata.entry_points(group=kind.group)}


def load(plugin: Plugin) -> Any:
    """The class of a plugin; of a drive protocol its row.

    Raises:
        PluginError: there is no such module or class, it fails, or it has the wrong type.
    """
    return _found(plugin) if plugin.folder else _installed(plugin)


@lru_cache(maxsize=64)
def _installed(plugin: Plugin) -> Any:
    """What is shipped or installed, looked at once: it isn't edited while a process runs."""
    return _found(plugin)


def _found(plugin: Plugin) -> Any:
    module_name, _, path = plugin.target.partition(":")
    if not module_name or not path:
        raise PluginError(f'must be "{plugin.kind.form}", not "{plugin.target}"')
    module = _module(plugin, module_name)
    found: Any = module
    for part in path.split("."):
        found = getattr(found, part, None)
        if found is None:
            names = [n for n, v in vars(module).items() if _is_own(plugin.kind, v, module)]
            has = f"; it has {', '.join(names)}" if names else ""
            raise PluginError(f"{_where(module)} has no {path}{has}")
    fault = _FAULTS[plugin.kind](found)
    if fault is not None:
        others = [kind.word for kind in Kind if _FAULTS[kind](found) is None]
        why = f"it is a {' or a '.join(others)}" if others else fault
        raise PluginError(f"{_where(module)}: {path} is no {plugin.kind.word}: {why}")
    return found


def _is_own(kind: Kind, value: object, module: ModuleType) -> bool:
    if kind is Kind.DRIVE:
        return _protocol_fault(value) is None
    return isinstance(value, type) and value.__module__ == module.__name__


def _where(module: ModuleType) -> str:
    return getattr(module, "__file__", None) or module.__name__


def file_of(found: type) -> str:
    """The file of a class; the name of its module if that has none."""
    module = sys.modules.get(found.__module__)
    return found.__module__ if module is None else _where(module)


def _module(plugin: Plugin, name: str) -> ModuleType:
    beside = _beside(plugin.folder, name)
    try:
        if beside is not None:
            return _loaded(beside, name)
        if plugin.folder and plugin.folder not in sys.path:
            sys.path.append(plugin.folder)
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if beside is None and error.name is not None and f"{name}.".startswith(f"{error.name}."):
            looked = f"no {name}.py in {plugin.folder}, and " if plugin.folder else ""
            raise PluginError(f"{looked}no module {name} is installed") from error
        raise PluginError(raised(error)) from error
    except PluginError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(raised(error)) from error


def _beside(folder: str, name: str) -> Path | None:
    """The module of this name in a folder, None if there is none."""
    if not folder or "." in name:
        return None
    options = (Path(folder) / f"{name}.py", Path(folder) / name / "__init__.py")
    return next((path.resolve() for path in options if path.is_file()), None)


def _loaded(file: Path, name: str) -> ModuleType:
    """A module from its file, again only when the file has changed."""
    about = file.stat()
    stamp = f"{file} {about.st_mtime_ns} {about.st_size}"
    unique = f"{name}@{zlib.crc32(stamp.encode()):08x}"
    if unique in sys.modules:
        return sys.modules[unique]
    packages = [str(file.parent)] if file.name == "__init__.py" else None
    spec = importlib.util.spec_from_file_location(unique, file, submodule_search_locations=packages)
    if spec is None or spec.loader is None:
        raise PluginError(f"{file} can't be imported")
    folder = str(file.parent.parent if packages else file.parent)
    if folder not in sys.path:
        sys.path.append(folder)
    module = importlib.util.module_from_spec(spec)
    sys.modules[unique] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[unique]
        raise
    return module


def raised(error: BaseException) -> str:
    """An error of a plug-in's code with the place that raised it."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}: {error.msg}"
    frames = traceback.extract_tb(error.__traceback__)
    place = f"{frames[-1].filename}, line {frames[-1].lineno}: " if frames else ""
    return f"{place}{type(error).__name__}: {error}"


# --- what a class has to be -----------------------------------------------------------------------


def _parameters_fault(found: object) -> str | None:
    if isinstance(found, type) and issubclass(found, Parameters):
        if "__dataclass_fields__" in vars(found):
            return None
        return f"{found.__name__} must be a dataclass(frozen=True, slots=True, kw_only=True)"
    return "it must derive from configs.parameters.Parameters"


def _law_fault(law: object) -> str | None:
    if not isinstance(law, type):
        return "it is no class"
    found: Any = law
    missing = [name for name in ("Gains", "SIGNALS", "step", "hold") if not hasattr(found, name)]
    if "step" not in missing and _is_of_protocol(law, "step"):
        missing.append("step")
    if missing:
        return f"it has no {', no '.join(missing)} (see agents.laws.interface.Law)"
    fault = _parameters_fault(found.Gains)
    if fault is not None:
        return f"its Gains: {fault}"
    if "law" in found.Gains.__dataclass_fields__:
        return "its Gains: law is the key that names the law; choose another name"
    return signals_fault(found.SIGNALS)


def _is_of_protocol(law: type, name: str) -> bool:
    """Whether a class has a method only as the empty one of a protocol."""
    owner = next((base for base in law.__mro__ if name in vars(base)), None)
    return owner is not None and getattr(owner, "_is_protocol", False)


def _path_fault(found: Any) -> str | None:
    return _shape_fault(found, OwnOffset, Kind.OFFSET)


def _offset_fault(found: Any) -> str | None:
    return _shape_fault(found, OwnPath, Kind.PATH)


def _shape_fault(found: Any, other: type, other_kind: Kind) -> str | None:
    if isinstance(found, type) and issubclass(found, other):
        return f"it is a {other_kind.word}"
    fault = _parameters_fault(found)
    if fault is not None:
        return fault
    if not callable(getattr(found, "jet", None)):
        return "it has no jet(s)"
    if "kind" in found.__dataclass_fields__:
        return "kind is the key that names the class; choose another name"
    return None


def _protocol_fault(row: Any) -> str | None:
    ends = ("client", "node", "cyclic_messages", "words", "node_seen", "section")
    missing = [end for end in ends if not hasattr(row, end)]
    if missing:
        return f"it has no {', no '.join(missing)} (see bridge.drives.interface.DriveProtocol)"
    fault = _parameters_fault(row.section)
    if fault is None and not issubclass(row.section, Drive):
        fault = "it must derive from configs.drives.Drive"
    if fault is None and "protocol" in row.section.__dataclass_fields__:
        fault = "protocol is the key that names the row; choose another name"
    return None if fault is None else f"its section: {fault}"


_FAULTS = {
    Kind.LAW: _law_fault,
    Kind.PATH: _path_fault,
    Kind.OFFSET: _offset_fault,
    Kind.DRIVE: _protocol_fault,
}


# --- a plugin with its parameters -----------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Choice:
    """A class of a file's choice, with its parameters; a process imports the class first."""

    plugin: Plugin
    parameters: Parameters

    @property
    def name(self) -> str:
        """As in the file."""
        return self.plugin.name

    @property
    def recorded(self) -> bool:
        """Whether it is a record's whose class isn't here: keys and values alone."""
        return isinstance(self.parameters, Recorded)

    @property
    def kind(self) -> str:
        """The name, as shapes have theirs."""
        return self.plugin.name

    def load(self) -> Any:
        """The class."""
        return load(self.plugin)

    def __getattr__(self, key: str) -> Any:
        """A parameter, as the file's table has it: `scenario.control.k1`."""
        if key.startswith("_"):
            raise AttributeError(key)
        return getattr(self.parameters, key)

    def __dir__(self) -> list[str]:
        return [*object.__dir__(self), *(one.name for one in fields(self.parameters))]

    def __repr__(self) -> str:
        return f"{self.name}: {self.parameters}"

    def __reduce__(self) -> Any:
        return _restored, (self.plugin, pickle.dumps(self.parameters))


def _restored(plugin: Plugin, parameters: bytes) -> Choice:
    load(plugin)
    return Choice(plugin, pickle.loads(parameters))


@dataclass(frozen=True, slots=True)
class Recorded(Parameters):
    """Parameters of a class that isn't here, as a record has them."""

    values: tuple[tuple[str, Any], ...]
