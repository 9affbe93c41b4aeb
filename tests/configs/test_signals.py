"""Names of recorded signals."""

from configs.signals import AGENT_SIGNALS, PLANT_SIGNALS


def test_hats_are_estimates_of_the_paper() -> None:
    hats = {s.name for s in (*PLANT_SIGNALS, *AGENT_SIGNALS) if "_hat" in s.name}
    assert hats == {"v_r_hat", "kappa_hat", *(f"theta_hat_{n}" for n in range(1, 9))}
