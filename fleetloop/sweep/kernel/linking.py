"""One module out of the sources: the loop and every equation that it calls, for the compiler.

From a function on, all functions, constants and tuples with names that it uses are taken out of
the modules that define them, as they stand there, and put behind each other. So there is one text
of each equation, the one that the controllers and the plant run; their modules may be compiled
(`docs/compiled.md`) and have no bytecode, but sources they have.

Left out are docstrings and annotations. `SAID_AGAIN` has what the compiler hasn't, or has
otherwise: names of Python that become functions of `primitives`, tested against what they stand
for.
"""

import ast
import builtins
import importlib
import symtable
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

PRIMITIVES: Final = "fleetloop.sweep.kernel.primitives"
SAID_AGAIN: Final[Mapping[tuple[str, str], str]] = {
    ("builtins", "min"): "least",
    ("builtins", "max"): "most",
    ("bisect", "bisect_right"): "bisect_right",
}
"""(module, name) -> the name in `primitives`."""


OURS: Final = ("agents", "bridge", "configs", "fleetloop", "plant")
_Definition = ast.FunctionDef | ast.ClassDef | ast.Assign


class LinkError(TypeError):
    """A function can't be taken out of its module: the text says which, and why."""


class _Source(NamedTuple):
    """A module by its text."""

    name: str
    defined: dict[str, _Definition]
    imported: dict[str, tuple[str, str]]
    """Name here -> module, name there; "" of a whole module."""


@cache
def _source(module: str) -> _Source:
    package, _, rest = module.partition(".")
    found = importlib.import_module(package).__file__
    if found is None:
        raise LinkError(f"{package} has no file")
    path = Path(found).parent.joinpath(*rest.split(".")).with_suffix(".py")
    defined: dict[str, _Definition] = {}
    imported: dict[str, tuple[str, str]] = {}
    for node in ast.parse(path.read_text("utf-8")).body:
        match node:
            case ast.FunctionDef() | ast.ClassDef():
                defined[node.name] = node
            case ast.Assign(targets=[target]):
                defined |= dict.fromkeys(_names_in(target), node)
            case ast.AnnAssign(target=ast.Name(), value=ast.expr() as value):
                plain = ast.Assign([node.target], value, lineno=node.lineno)
                defined |= dict.fromkeys(_names_in(node.target), plain)
            case ast.Import():
                imported |= {one.asname or one.name: (one.name, "") for one in node.names}
            case ast.ImportFrom(module=str(there)):
                imported |= {one.asname or one.name: (there, one.name) for one in node.names}
    return _Source(module, defined, imported)


def _names_in(target: ast.expr) -> list[str]:
    return [node.id for node in ast.walk(target) if isinstance(node, ast.Name)]


class _Bare(ast.NodeTransformer):
    """Takes away what says nothing to the compiler, and puts in what is said again."""

    def __init__(self, renamed: Mapping[str, str]) -> None:
        self._renamed = renamed

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        node.returns, node.decorator_list = None, []
        node.body = _without_docstring(node.body)
        self.generic_visit(node)
        return node

    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.annotation = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt:
        self.generic_visit(node)
        if node.value is None:
            return ast.Pass()
        return ast.Assign([node.target], node.value, lineno=node.lineno)

    def visit_Tuple(self, node: ast.Tuple) -> ast.Tuple:
        """Written out: (*(a, b), c) is (a, b, c)."""
        elements: list[ast.expr] = []
        for one in node.elts:
            match one:
                case ast.Starred(value=ast.Tuple(elts=inner)):
                    elements += inner
                case _:
                    elements.append(one)
        node.elts = elements
        self.generic_visit(node)
        return node

    def visit_Name(self, node: ast.Name) -> ast.Name:
        node.id = self._renamed.get(node.id, node.id)
        return node


def _without_docstring(body: list[ast.stmt]) -> list[ast.stmt]:
    match body:
        case [ast.Expr(value=ast.Constant(value=str())), *rest]:
            return rest
    return body


class Linker:
    """Gathers what a function needs.

    Args:
        decorator: of every function but those that have another.
        decorators: by the names of these.
    """

    def __init__(self, decorator: str, decorators: Mapping[str, str] | None = None) -> None:
        self._decorator, self._decorators = decorator, decorators or {}
        self._texts: dict[str, str] = {}  # by name, what it needs before it
        self._from: dict[str, str] = {}  # name -> module
        self._imports: set[str] = set()

    def add(self, module: str, name: str) -> None:
        """Take in one name of a module, and all that it needs.

        Raises:
            LinkError: it isn't defined there, or another one has its name.
        """
        source = _source(module)
        node = source.defined.get(name)
        if node is None:
            raise LinkError(f"{module} has no {name} of its own")
        known = self._from.setdefault(name, module)
        if known != module:
            raise LinkError(f"{name} is defined in {known} and in {module}: one needs another name")
        if name in self._texts:
            return
        if isinstance(node, ast.ClassDef):
            self._texts[name] = self._class(source, node)
            return
        bare = _Bare({}).visit(ast.parse(ast.unparse(node)))
        renamed = {}
        for used in _globals_of(ast.unparse(bare)):
            if used == name or used in _names_of(node):
                continue
            needed = self._resolve(source, used)
            if needed != used:
                renamed[used] = needed
        text = ast.unparse(_Bare(renamed).visit(bare))
        if isinstance(node, ast.FunctionDef):
            text = f"{self._decorators.get(name, self._decorator)}\n{text}"
        for one in _names_of(node):
            self._texts[one], self._from[one] = text, module

    def _resolve(self, source: _Source, used: str) -> str:
        """Take in what a name of a module stands for; the name that it has here."""
        there, original = source.imported.get(used, (source.name, used))
        if there == source.name and used not in source.defined:
            if not hasattr(builtins, used):
                raise LinkError(f"{source.name}: {used} is neither defined nor imported")
            there = "builtins"
        again = SAID_AGAIN.get((there, original))
        if again is not None:
            self.add(PRIMITIVES, again)
            return again
        if there == "builtins":
            return used
        if there.split(".")[0] in OURS and original:
            if original != used:
                raise LinkError(f"{source.name}: {original} is imported by another name")
            self.add(there, original)
        elif original:
            as_name = "" if original == used else f" as {used}"
            self._imports.add(f"from {there} import {original}{as_name}")
        else:
            self._imports.add(f"import {there}" + ("" if there == used else f" as {used}"))
        return used

    def _class(self, source: _Source, node: ast.ClassDef) -> str:
        """A tuple with names: its fields, without methods."""
        bases = [ast.unparse(base) for base in node.bases]
        if bases != ["NamedTuple"]:
            raise LinkError(f"{source.name}.{node.name} is no tuple with names")
        self._imports.add("from typing import NamedTuple")
        fields = [ast.unparse(one.target) for one in node.body if isinstance(one, ast.AnnAssign)]
        return "\n".join(
            [f"class {node.name}(NamedTuple):", *(f"    {it}: float" for it in fields)]
        )

    def text(self, head: str) -> str:
        """The module: `head`, imports, definitions in the order in which they are needed."""
        return "\n\n".join(
            [head, "\n".join(sorted(self._imports)), *dict.fromkeys(self._texts.values())]
        )


def _names_of(node: _Definition) -> list[str]:
    if isinstance(node, ast.Assign):
        return [name for target in node.targets for name in _names_in(target)]
    return [node.name]


def _globals_of(text: str) -> list[str]:
    """Names that a definition uses from around it, in order."""
    found: dict[str, None] = {}
    for table in _tables(symtable.symtable(text, "definition", "exec")):
        for symbol in table.get_symbols():
            at_top = table.get_type() == "module"
            if symbol.is_referenced() and (at_top or symbol.is_global()):
                found[symbol.get_name()] = None
    return list(found)


def _tables(table: symtable.SymbolTable) -> Iterator[symtable.SymbolTable]:
    yield table
    for child in table.get_children():
        yield from _tables(child)
