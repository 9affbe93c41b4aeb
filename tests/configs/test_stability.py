"""Checks before a run, against what is known in closed form."""

import pytest

from configs.loading import load, loads
from configs.stability import delay_class, findings, synchronisation
from configs.topology import Graph


def circulant(n: int, predecessors: int) -> Graph:
    names = [f"r{k}" for k in range(n)]
    edges = [(names[(k - d) % n], names[k]) for k in range(n) for d in range(1, predecessors + 1)]
    return Graph.of(names, edges, names[:1])


def test_a_ring_of_three_needs_exactly_one_half() -> None:
    # Eigenvalues 1 − exp(±2πi/3) = 3/2 ∓ i √3/2, so Im²/Re = (3/4)/(3/2).
    finding = synchronisation(circulant(3, 1), p=1.0, q=1.0)
    assert finding.level == "ok"
    assert "1 > 0.5" in finding.text
    assert synchronisation(circulant(3, 1), p=0.7, q=1.0).level == "error"


def test_the_papers_gains_fail_on_twenty_robots_that_hear_their_three_predecessors() -> None:
    finding = synchronisation(circulant(20, 3), p=2.0, q=1.0)
    assert finding.level == "error"
    assert "4.46" in finding.text


def test_in_degree_decides_how_much_delay_is_stood() -> None:
    assert "any switching" in delay_class(circulant(4, 1), p=2.0, q=1.0).text
    assert "any delay" in delay_class(circulant(4, 2), p=2.0, q=1.0).text
    assert delay_class(circulant(5, 3), p=2.0, q=1.0).level == "warning"


@pytest.mark.parametrize("name", ["paper", "paper_ring", "paper_tree", "paper_star", "paper_extra"])
def test_the_papers_scenarios_are_sound(name: str) -> None:
    assert {finding.level for finding in findings(load(name))} <= {"ok", "warning"}


def test_gains_for_1_khz_are_refused_at_100_hz_with_gains_that_suit() -> None:
    scenario = load("paper", ("clock.control_period_s=0.01", "clock.countdown_s=0.5"))
    found = [f for f in findings(scenario) if "sampled speed loop" in f.title]
    assert {finding.level for finding in found} == {"error"}
    assert all("suits this rate" in finding.text for finding in found)


def test_a_disturbance_beyond_the_drives_torque_is_an_error() -> None:
    text = (
        'schema = 1\nname = "x"\n[drive]\npreset = "limited"\n[disturbance]\namplitude_N_m = 0.6\n'
        '[[robot]]\nname = "r1"\npose = { x_m = 0.0, y_m = 0.0 }\n'
    )
    levels = [f.level for f in findings(loads("f", text)) if "wheel torque" in f.title]
    assert levels == ["error"]
