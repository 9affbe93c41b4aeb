"""Main effects and their ranking: closed forms of functions that are known, SciPy's intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binomtest, kruskal, rankdata, t

from fleetloop.sweep.report.columns import Column
from fleetloop.sweep.report.effects import (
    binned,
    effect_of,
    explained,
    mean_interval,
    ranking,
    ranks,
    rate_interval,
)
from fleetloop.sweep.report.results import FAILURE_RATE

GRID = np.array([(a, b) for a in range(5) for b in range(8)], dtype=float)
A, B = Column("a", GRID[:, 0]), Column("b", GRID[:, 1])


def corrected(eta2: float, bins: int, count: int) -> float:
    """ε² from η²: 1 − (1 − η²) (N − 1)/(N − B)."""
    return 1.0 - (1.0 - eta2) * (count - 1) / (count - bins)


def test_of_a_linear_function_on_a_grid_each_factor_has_its_share_of_the_variance() -> None:
    result = Column("y", 3.0 * A.values + 2.0 * B.values)
    of_a, of_b = 9.0 * A.values.var(), 4.0 * B.values.var()
    places = [binned(one, one.values)[0] for one in (A, B)]
    shares = [explained(one, result.values) for one in places]
    eta2 = of_a / (of_a + of_b), of_b / (of_a + of_b)
    assert shares[0] == pytest.approx(corrected(eta2[0], 5, 40))
    assert shares[1] == pytest.approx(corrected(eta2[1], 8, 40))


def test_of_ranks_it_is_the_statistic_of_kruskal_and_wallis() -> None:
    y = np.random.default_rng(4).standard_cauchy(40) + A.values
    groups = [y[A.values == level] for level in range(5)]
    eta2 = kruskal(*groups).statistic / 39
    share = effect_of(A, Column("y", y), 0.95).share
    assert share == pytest.approx(max(0.0, corrected(eta2, 5, 40)))
    assert share > 0.0


def test_its_means_are_the_line() -> None:
    result = Column("y", 3.0 * A.values + 2.0 * B.values)
    bins = effect_of(A, result, 0.95).bins
    assert [one.at for one in bins] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert [one.mean for one in bins] == pytest.approx(3.0 * np.arange(5) + 2.0 * 3.5)
    assert [one.cases for one in bins] == [8] * 5


def test_of_samples_a_linear_function_has_about_its_first_order_sobol_indices() -> None:
    rng = np.random.default_rng(1)
    x = rng.random((4000, 3))
    result = Column("y", 2.0 * x[:, 0] + x[:, 1])
    effects = ranking([Column(str(n), x[:, n]) for n in range(3)], result, 0.95)
    assert [one.factor.name for one in effects] == ["0", "1", "2"]
    assert [one.share for one in effects] == pytest.approx([0.8, 0.2, 0.0], abs=0.04)


def test_an_effect_that_rises_and_falls_is_seen_though_its_correlation_is_none() -> None:
    x = np.linspace(-1.0, 1.0, 2001)
    y = x**2
    assert abs(np.corrcoef(x, y)[0, 1]) < 1e-9
    assert effect_of(Column("x", x), Column("y", y), 0.95).share > 0.9


def test_what_has_no_effect_has_none_on_average_though_bins_always_explain_something() -> None:
    rng = np.random.default_rng(2)
    places = np.repeat(np.arange(10), 6)
    draws = [rng.normal(size=60) for _ in range(300)]
    raw = np.mean([1.0 - _within(places, y) / ((y - y.mean()) ** 2).sum() for y in draws])
    assert raw == pytest.approx(9 / 59, abs=0.01)  # (B − 1)/(N − 1): what is corrected
    # Cut off at 0, so its mean lies above that of the uncorrected difference, but far below `raw`.
    assert np.mean([explained(places, y) for y in draws]) < 0.05


def _within(places: np.ndarray, y: np.ndarray) -> float:
    return sum(((y[places == n] - y[places == n].mean()) ** 2).sum() for n in np.unique(places))


@given(arrays(np.int64, 40, elements=st.integers(-100, 100)))
def test_a_share_is_a_share_on_any_scale(y: np.ndarray) -> None:
    share = effect_of(A, Column("y", y.astype(float)), 0.95).share
    other = effect_of(A, Column("y", np.sinh(0.1 * y)), 0.95).share
    if np.isnan(share):
        assert np.isnan(other)
        return
    assert 0.0 <= share <= 1.0
    assert other == pytest.approx(share, abs=1e-6)


@given(arrays(np.int64, st.integers(0, 30), elements=st.integers(-5, 5)))
def test_equal_values_share_their_ranks(values: np.ndarray) -> None:
    assert ranks(values.astype(float)).tolist() == rankdata(values).tolist()


def test_without_variance_or_cases_to_spare_no_share_is_known() -> None:
    assert np.isnan(effect_of(A, Column("y", np.ones(40)), 0.95).share)
    few = Column("x", np.arange(5.0))
    assert np.isnan(effect_of(few, Column("y", np.arange(5.0)), 0.95).share)


@given(st.integers(0, 60), st.integers(1, 60), st.sampled_from([0.9, 0.95, 0.99]))
def test_the_interval_of_a_rate_is_wilsons(failed: int, count: int, confidence: float) -> None:
    failed = min(failed, count)
    values = np.array([1.0] * failed + [0.0] * (count - failed))
    theirs = binomtest(failed, count).proportion_ci(confidence, "wilson")
    assert rate_interval(values, confidence) == pytest.approx((theirs.low, theirs.high), abs=1e-12)


@given(arrays(np.float64, st.integers(2, 30), elements=st.floats(-1e3, 1e3)))
def test_the_interval_of_a_mean_is_students(values: np.ndarray) -> None:
    low, high = mean_interval(values, 0.95)
    error = values.std(ddof=1) / np.sqrt(len(values))
    if error > 0.0:
        theirs = t.interval(0.95, len(values) - 1, loc=values.mean(), scale=error)
        assert (low, high) == pytest.approx(theirs, rel=1e-9, abs=1e-9)


def test_of_one_case_a_mean_has_no_interval_but_a_rate_has() -> None:
    assert np.isnan(mean_interval(np.array([1.0]), 0.95)).all()
    low, high = rate_interval(np.array([1.0]), 0.95)
    assert 0.0 < low < high == 1.0


def test_cases_without_a_value_are_in_no_bin() -> None:
    y = A.values.copy()
    y[A.values == 2.0] = np.nan
    bins = effect_of(A, Column("y", y), 0.95).bins
    assert [one.at for one in bins] == [0.0, 1.0, 3.0, 4.0]


@given(arrays(np.float64, st.integers(12, 300), elements=st.floats(-1e3, 1e3)))
def test_every_value_is_in_a_bin_that_holds_it(x: np.ndarray) -> None:
    places, labels = binned(Column("x", x), x)
    assert places.min() >= 0
    assert places.max() < len(labels)
    order = np.argsort(x, kind="stable")
    assert (np.diff(places[order]) >= 0).all()


def test_bins_of_samples_have_equal_shares_and_at_most_ten_are_made() -> None:
    x = np.random.default_rng(3).lognormal(size=1000)
    bins = effect_of(Column("x", x), Column(FAILURE_RATE, np.zeros(1000)), 0.95).bins
    assert [one.cases for one in bins] == [100] * 10
    few = effect_of(Column("x", x[:50]), Column(FAILURE_RATE, np.zeros(50)), 0.95).bins
    assert len(few) == 3


def test_a_value_that_most_cases_have_is_a_bin_by_itself() -> None:
    x = np.concatenate([np.zeros(900), np.linspace(0.1, 1.0, 100)])
    y = (x > 0.0).astype(float)
    effect = effect_of(Column("x", x), Column(FAILURE_RATE, y), 0.95)
    assert [one.cases for one in effect.bins] == [900, 20, 20, 20, 20, 20]
    assert effect.bins[0].label == "0"
    assert effect.share > 0.99


def test_levels_of_texts_are_bins_by_name() -> None:
    laws = Column("law", np.array([0.0, 1.0, 0.0, 1.0]), levels=("paper", "robust"))
    bins = effect_of(laws, Column("y", np.array([1.0, 5.0, 3.0, 7.0])), 0.95).bins
    assert [(one.label, one.mean) for one in bins] == [("paper", 2.0), ("robust", 6.0)]
