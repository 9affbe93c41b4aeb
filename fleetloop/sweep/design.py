"""Designs: which values the factors have in which case.

    grid             all combinations of levels; the last factor changes fastest
    random           every case by itself, independently
    latin_hypercube  of N cases each of N equal shares of every factor has one (McKay et al. 1979)
    sobol            a scrambled Sobol' sequence (Owen 1998): low discrepancy, best with 2^m cases

A case's values follow from the study alone, its number and the study's seed: not from what was
computed before. So a study goes on in another process, or on another machine, where it was.
"""

from collections.abc import Sequence
from math import ceil, log2

import numpy as np

from fleetloop.sweep.draws import Draw, Value, level
from fleetloop.sweep.extra import require
from fleetloop.sweep.study import Study


class Design:
    """The cases of a study by their numbers, 0 and up.

    Args:
        study: whose design it is.
        draws: of its factors.
    """

    def __init__(self, study: Study, draws: Sequence[Draw]) -> None:
        self._draws = tuple(draws)
        self._seed = study.seed
        self._grid = study.design == "grid"
        self._samples: np.ndarray | None = None
        if study.design in ("latin_hypercube", "sobol"):
            self._samples = _samples(study.design, len(draws), study.total, study.seed)

    def values(self, case: int) -> tuple[Value, ...]:
        """The values of a case, in the order of the factors."""
        if self._grid:
            return self._of_grid(case)
        u = self._drawn(case) if self._samples is None else self._samples[case]
        return tuple(draw.at(float(one)) for draw, one in zip(self._draws, u, strict=True))

    def _of_grid(self, case: int) -> tuple[Value, ...]:
        values = []
        for draw in reversed(self._draws):
            case, n = divmod(case, draw.count or 1)
            values.append(level(draw, n))
        return tuple(reversed(values))

    def _drawn(self, case: int) -> np.ndarray:
        sequence = np.random.SeedSequence(self._seed, spawn_key=(case,))
        return np.random.default_rng(sequence).random(len(self._draws))


def _samples(design: str, factors: int, cases: int, seed: int) -> np.ndarray:
    """Samples in [0, 1), a row for each case.

    Raises:
        ScenarioError: SciPy isn't there.
    """
    require("scipy")
    from scipy.stats import qmc

    rng = np.random.default_rng(np.random.SeedSequence(seed))
    made: np.ndarray
    if design == "sobol":
        made = qmc.Sobol(factors, scramble=True, rng=rng).random_base2(ceil(log2(max(cases, 1))))
        return made[:cases]
    made = qmc.LatinHypercube(factors, rng=rng).random(cases)
    return made
