"""The trials of a tuning in Optuna's storage: a journal in the tuning's folder.

    trials.journal   Optuna's study `fleetloop`, a line of JSON for each change; its tools open it
    user attributes  of each trial: what was tried, what it came to

A trial is chosen by a sampler of its own: its seed follows from the tuning's seed and the number of
trials that are done. So what is tried depends on those alone, and a tuning that goes on tries what
it would have tried without the break. A trial that was broken off is marked as failed, which no
sampler looks at, and is repeated. A line that was broken off, as by a kill, is cut.
"""

import fcntl
import json
import logging
import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.sweep.draws import Value
from fleetloop.tune.scores import Score, Trial
from fleetloop.tune.tuning import Tuning

FILE, LOCK, NAME = "trials.journal", ".lock", "fleetloop"
NEEDS = "fleetloop tune needs Optuna: pip install 'fleetloop[sweep]'"
_VALUES, _SCORE = "values", "score"
_LEAST_FOR_IMPORTANCES = 10


class Asked(NamedTuple):
    """A trial that is to be done."""

    number: int
    values: Mapping[str, Value]
    trial: Any


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Nobody else works in this folder meanwhile.

    Raises:
        ScenarioError: somebody does.
        InfrastructureError: the folder can't be written.
    """
    try:
        lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise InfrastructureError(f"can't write {folder}: {error.strerror or error}") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise ScenarioError(f"{folder}: another command is at work on this tuning") from None
    try:
        yield
    finally:
        os.close(lock)


@contextmanager
def storage_of(folder: Path, tuning: Tuning) -> Iterator["Storage"]:
    """The trials of a tuning's folder.

    Raises:
        ScenarioError: Optuna isn't there.
        InfrastructureError: the file is damaged, or can't be read or written.
    """
    optuna = optuna_here()
    from optuna.storages.journal import JournalFileBackend

    path = folder / FILE
    _mend(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Optuna, about Optuna
            lock: Any = _Ours()
            backend = JournalFileBackend(str(path), lock_obj=lock)
            study = optuna.create_study(
                storage=optuna.storages.JournalStorage(backend),
                study_name=NAME,
                direction=tuning.objective.direction.replace("ise", "ize"),
                load_if_exists=True,
            )
            yield Storage(optuna, study, tuning)
    except OSError as error:
        raise InfrastructureError(
            f"{error.filename or path}: {error.strerror or error}; trials that were written before"
            f" are kept, go on with fleetloop tune --resume {folder}"
        ) from error


class Storage:
    """The trials of a tuning."""

    def __init__(self, optuna: Any, study: Any, tuning: Tuning) -> None:
        self._optuna = optuna
        self._study = study
        self._tuning = tuning
        self._parameters = {one.column: one for one in tuning.parameter}
        self._states = states = optuna.trial.TrialState
        for _ in study.get_trials(deepcopy=False, states=(states.WAITING,)):
            study.ask()
        for left in study.get_trials(deepcopy=False, states=(states.RUNNING,)):
            study.tell(left.number, state=states.FAIL)

    def done(self) -> list[Trial]:
        """All trials that are done, in their order."""
        found = self._study.get_trials(deepcopy=False, states=(self._states.COMPLETE,))
        return [
            Trial(n, one.user_attrs[_VALUES], Score(**one.user_attrs[_SCORE]))
            for n, one in enumerate(found)
        ]

    def ask(self, number: int) -> Asked:
        """Choose the next trial, `number` of which are done."""
        self._study.sampler = self._sampler(number)
        given = self._tuning.baseline if number == 0 else None
        if given is not None:
            drawn = {name: self._parameters[name].drawn(value) for name, value in given.items()}
            self._study.enqueue_trial(drawn)
        trial = self._study.ask(
            {name: one.distribution() for name, one in self._parameters.items()}
        )
        values = given or {
            name: one.value(trial.params[name]) for name, one in self._parameters.items()
        }
        return Asked(number, values, trial)

    def tell(self, asked: Asked, score: Score) -> Trial:
        """Keep what a trial came to."""
        trial = asked.trial
        trial.set_user_attr(_VALUES, dict(asked.values))
        trial.set_user_attr(_SCORE, score.told())
        for name, missed in score.missed.items():
            trial.set_constraint(name, missed)
        worst = float("inf") * self._tuning.objective.sign
        self._study.tell(trial, worst if score.objective is None else score.objective)
        return Trial(asked.number, asked.values, score)

    def drop(self, asked: Asked) -> None:
        """A trial was broken off."""
        self._study.tell(asked.trial, state=self._states.FAIL)

    def importances(self) -> dict[str, float]:
        """How much each parameter decides, of all together 1; none of few trials.

        By PED-ANOVA (Watanabe et al. 2023): of getting among the best tenth.
        """
        if len(self._parameters) < 2 or len(self.done()) < _LEAST_FOR_IMPORTANCES:
            return {}
        evaluator = self._optuna.importance.PedAnovaImportanceEvaluator()
        try:
            found = self._optuna.importance.get_param_importances(self._study, evaluator=evaluator)
        except (RuntimeError, ValueError):  # as if no trial has a number
            return {}
        return {name: float(share) for name, share in found.items() if np.isfinite(share)}

    def _sampler(self, number: int) -> Any:
        sequence = np.random.SeedSequence(self._tuning.seed, spawn_key=(number,))
        return self._optuna.samplers.TPESampler(
            seed=int(sequence.generate_state(1)[0]),
            n_startup_trials=self._tuning.startup_trials,
            multivariate=True,
            constant_liar=False,
        )


class _Ours:
    """The journal's lock: `alone` has it for us."""

    def acquire(self) -> bool:
        """Ours."""
        return True

    def release(self) -> None:
        """Ours still."""


def _mend(path: Path) -> None:
    """Cut a last line that isn't whole; refuse a file that is damaged otherwise.

    Raises:
        InfrastructureError: it is, or it can't be read or written.
    """
    try:
        data = path.read_bytes() if path.exists() else b""
        whole = data[: data.rfind(b"\n") + 1]
        if len(whole) < len(data):
            os.truncate(path, len(whole))
    except OSError as error:
        raise InfrastructureError(f"{path}: {error.strerror or error}") from error
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            sound = "op_code" in json.loads(line)
        except (ValueError, TypeError):
            sound = False
        if not sound:
            raise InfrastructureError(
                f"{path}: damaged at line {number}; its trials can't be read: bring back a copy of"
                " this file, or begin the tuning again"
            )


def optuna_here() -> Any:
    """Optuna, silent.

    Raises:
        ScenarioError: it isn't there.
    """
    try:
        import optuna
    except ImportError:
        raise ScenarioError(NEEDS) from None
    optuna.logging.set_verbosity(logging.ERROR)
    return optuna
