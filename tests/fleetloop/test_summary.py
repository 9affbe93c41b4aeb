"""Numbers of a run."""

import numpy as np
import pytest

from configs.errors import ScenarioError
from configs.sections import Expect
from fleetloop.summary import check_expectations, settle_s

T = np.arange(0.0, 10.0, 0.1)


def test_an_error_has_settled_after_its_last_time_outside_the_band() -> None:
    values = np.exp(-T)
    assert settle_s(T, values, 0.05) == pytest.approx(2.9)  # e^−3 < 0.05 < e^−2.9


def test_a_bump_counts_and_the_sign_does_not() -> None:
    values = np.zeros_like(T)
    values[70] = -0.2
    assert settle_s(T, values) == pytest.approx(7.0)


def test_never_outside_is_zero_and_outside_at_the_end_is_never() -> None:
    assert settle_s(T, np.zeros_like(T)) == 0.0
    assert settle_s(T, np.ones_like(T)) is None
    assert settle_s(T, np.where(T > 5, np.nan, 0.0)) is None


def test_an_expectation_of_a_signal_that_is_not_recorded_lists_those_that_are() -> None:
    with pytest.raises(ScenarioError, match=r"expect\.0\.signal = 'x_error'.*s_spread.*x_e_m"):
        check_expectations([Expect(signal="x_error", max_abs=1.0)])
