"""Which scenarios a test of paths is about, and which of them -k selects.

a file            as it is, whatever its name
a name            of a shipped scenario
a folder          every *.toml below it that is meant as a scenario: it has `schema` and a key
that only scenarios have; a *.fleetloop.toml and what is no TOML at all count, too.
Not in folders of runs, nor in those whose names begin with a dot
"""

import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from configs.deployment import Deployment
from configs.errors import ScenarioError
from configs.files import text_of
from configs.loading import shipped
from configs.scenario import Scenario

SUFFIX = ".fleetloop.toml"
_MOST_BYTES = 1 << 24
_RUN_FILES = ("record.mcap", "summary.json")
_SCENARIO_ONLY = Scenario.model_fields.keys() - Deployment.model_fields.keys()
"""Keys by which a scenario differs from a deployment, which has a `schema` as well."""
_TOKEN = re.compile(r"\s*(\(|\)|[^\s()]+)")
Match = Callable[[str], bool]


def selected(paths: Sequence[str], expression: str = "") -> list[str]:
    """The scenarios of these paths that the expression selects, each once, in order.

    Raises:
        ScenarioError: a path isn't there, or the expression is none.
    """
    matches = matcher(expression)
    found = dict.fromkeys(source for path in paths for source in _of(path))
    return [source for source in found if matches(source)]


def _of(path: str) -> Iterator[str]:
    place = Path(path)
    if place.is_dir():
        yield from (str(file) for file in _below(place))
    elif place.is_file() or path in shipped():
        yield path
    else:
        raise ScenarioError(
            f"{path}: no file, folder or shipped scenario of this name"
            " (shipped: fleetloop check lists them)"
        )


def _below(folder: Path) -> Iterator[Path]:
    for place in sorted(folder.iterdir()):
        if place.name.startswith("."):
            continue
        if place.is_dir():
            if not any((place / name).exists() for name in _RUN_FILES):
                yield from _below(place)
        elif place.suffix == ".toml" and _is_scenario(place):
            yield place


def _is_scenario(file: Path) -> bool:
    if file.name.endswith(SUFFIX):
        return True
    try:
        data = tomllib.loads(text_of(file, "PATH", _MOST_BYTES))
    except (ScenarioError, tomllib.TOMLDecodeError):
        return True  # it says what is wrong with it
    return "schema" in data and (
        bool(_SCENARIO_ONLY & data.keys()) or isinstance(data.get("robot"), list)
    )


def matcher(expression: str) -> Match:
    """Whether a name is selected: words that it contains, with `and`, `or`, `not` and parentheses.

    Upper and lower case are one; without any word all are.

    Raises:
        ScenarioError: it can't be read.
    """
    tokens = _TOKEN.findall(expression)
    if not tokens:
        return lambda _: True
    matches = _either(tokens)
    if tokens:
        raise ScenarioError(f"-k {expression!r}: {tokens[0]!r} is one too many")
    return lambda name: matches(name.lower())


def _either(tokens: list[str]) -> Match:
    one = _both(tokens)
    while tokens and tokens[0] == "or":
        del tokens[0]
        one = _joined(any, one, _both(tokens))
    return one


def _both(tokens: list[str]) -> Match:
    one = _single(tokens)
    while tokens and tokens[0] == "and":
        del tokens[0]
        one = _joined(all, one, _single(tokens))
    return one


def _joined(how: Callable[[Iterator[bool]], bool], one: Match, other: Match) -> Match:
    return lambda name: how(it(name) for it in (one, other))


def _single(tokens: list[str]) -> Match:
    token = tokens.pop(0) if tokens else ""
    if token == "not":
        other = _single(tokens)
        return lambda name: not other(name)
    if token == "(":
        inner = _either(tokens)
        if not tokens or tokens.pop(0) != ")":
            raise ScenarioError("-k: a parenthesis is not closed")
        return inner
    if token in ("", ")", "and", "or"):
        raise ScenarioError(f"-k: a word is missing{f' before {token!r}' if token else ''}")
    word = token.lower()
    return lambda name: word in name
