"""Names of recorded signals."""

import pytest
from support.controller_rows import SIGNALS

from configs.signals import (
    PATH_ERRORS,
    PLANT_SIGNALS,
    Signal,
    controller_signals,
    law_table,
    signals_fault,
)

OWN = (Signal("gap_m", "m", ""), Signal("effort", "1", ""))


def test_hats_are_estimates_of_the_paper() -> None:
    hats = {s.name for s in (*PLANT_SIGNALS, *SIGNALS) if "_hat" in s.name}
    assert hats == {"v_r_hat", "kappa_hat", *(f"theta_hat_{n}" for n in range(1, 9))}


@pytest.mark.parametrize("hears", [(), ("r1", "r3")])
@pytest.mark.parametrize("table", [(), OWN, (*PATH_ERRORS, *OWN)])
def test_the_table_of_a_law_is_found_in_its_controllers_row(
    table: tuple[Signal, ...], hears: tuple[str, ...]
) -> None:
    own = tuple(signal for signal in table if signal not in PATH_ERRORS)
    assert law_table(controller_signals(table, hears)) == own


@pytest.mark.parametrize("name", ["x_m", "X_m", "late_s", "s_spread", "age_of_r1_s"])
def test_a_law_can_not_take_the_name_of_what_is_recorded_already(name: str) -> None:
    assert "is recorded of every robot already" in (signals_fault((Signal(name, "m", ""),)) or "")
