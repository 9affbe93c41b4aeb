"""A study with its base scenario: all that decides its cases, wherever they are computed.

A plan travels to other processes and is kept in the study's folder, so that a study that goes on
has the base that it was begun with.

    study.toml   the study, all defaults written out
    base.toml    the text of its base scenario
    base.json    where that came from
"""

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from configs.errors import InfrastructureError, ScenarioError
from configs.loading import folder_of, read, shipped
from fleetloop.results import run_folder
from fleetloop.sweep import study as studies
from fleetloop.sweep.study import Study

STUDY, BASE, ORIGIN = "study.toml", "base.toml", "base.json"


@dataclass(frozen=True, slots=True)
class Base:
    """The scenario that a study varies."""

    source: str
    """Its file, absolute, or its name, as a command in any folder names it."""
    name: str
    """Of its file, in messages."""
    text: str
    folder: str
    """Where its own laws and shapes are."""

    @classmethod
    def beside(cls, study: str, base: str) -> "Base":
        """The base that a study's file names.

        Raises:
            ScenarioError: there is none.
        """
        if base in shipped() or study in studies.shipped():
            name, text = read(base)
            return cls(base, name, text, folder_of(base))
        path = Path(study).parent / base
        name, text = read(str(path))
        source = str(path.absolute())
        return cls(source, name, text, folder_of(source))

    @classmethod
    def resume(cls, folder: Path) -> "Base":
        """The base of what was begun in a folder.

        Raises:
            ScenarioError: nothing was.
            InfrastructureError: its files can't be read.
        """
        text, origin = saved(folder / BASE), saved(folder / ORIGIN)
        try:
            found = json.loads(origin)
            return cls(found["source"], found["name"], text, found["folder"])
        except (ValueError, KeyError, TypeError) as error:
            raise ScenarioError(f"{folder / ORIGIN}: not a study's: {error!r}") from error

    def save(self, folder: Path) -> None:
        """Write its files.

        Raises:
            InfrastructureError: one can't be written.
        """
        origin = {"source": self.source, "name": self.name, "folder": self.folder}
        run_folder.write(folder / BASE, self.text)
        run_folder.write(folder / ORIGIN, json.dumps(origin, indent=2) + "\n")


@dataclass(frozen=True, slots=True)
class Plan:
    """A study and its base."""

    text: str
    """Of the study."""
    base: Base

    @classmethod
    def of(cls, source: str, *, cases: int | None = None, seed: int | None = None) -> "Plan":
        """Of a study's file or name.

        Raises:
            ScenarioError: it, or its base, isn't there or is wrong.
        """
        study = studies.load(source, cases=cases, seed=seed)
        return cls(study.to_toml(), Base.beside(source, study.base))

    @classmethod
    def resume(cls, folder: Path) -> "Plan":
        """Of a folder in which a study was begun.

        Raises:
            ScenarioError: none was.
            InfrastructureError: its files can't be read.
        """
        plan = cls(saved(folder / STUDY), Base.resume(folder))
        _study(plan.text, str(folder / STUDY))
        return plan

    def save(self, folder: Path) -> None:
        """Write its files.

        Raises:
            InfrastructureError: one can't be written.
        """
        self.base.save(folder)
        run_folder.write(folder / STUDY, self.text)

    @property
    def study(self) -> Study:
        """The study."""
        return _study(self.text, STUDY)


def saved(path: Path) -> str:
    """A file of what was begun in a folder.

    Raises:
        ScenarioError: nothing was.
        InfrastructureError: it can't be read.
    """
    try:
        return path.read_text("utf-8")
    except FileNotFoundError:
        raise ScenarioError(f"{path.parent}: no study was begun there: no {path.name}") from None
    except NotADirectoryError:
        raise ScenarioError(f"{path.parent}: a file, not the folder of a study") from None
    except (OSError, UnicodeError) as error:
        raise InfrastructureError(f"{path}: {error}") from error


@lru_cache(maxsize=8)
def _study(text: str, name: str) -> Study:
    return studies.loads(name, text)
