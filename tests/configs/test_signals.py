"""Names of recorded signals."""

from support.controller_rows import SIGNALS

from configs.signals import PLANT_SIGNALS


def test_hats_are_estimates_of_the_paper() -> None:
    hats = {s.name for s in (*PLANT_SIGNALS, *SIGNALS) if "_hat" in s.name}
    assert hats == {"v_r_hat", "kappa_hat", *(f"theta_hat_{n}" for n in range(1, 9))}
