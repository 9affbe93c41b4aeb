"""What is said of outcomes."""

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.results.outcome import of_error, unbegun
from fleetloop.suite.listing import account, command, counts_of, status_of

EXPECT = {
    "claim": "y_e_m within ±0.01 from 5 s",
    "held": False,
    "value": -0.0164,
    "worst": {"robots": ["r2"], "tick": 2505, "t_s": 5.01},
    "bound": {"max_abs": 0.01},
    "margin": -0.0064,
    "unit": "m",
}
RAN = {
    **unbegun("push", "failed", "", 1),
    "expectations": [EXPECT, EXPECT | {"held": True}],
    "cut_short": {},
    "stopped_robots": {"r1": "tick 3 (t = 0.006 s): no pose"},
    "notices": {},
    "bus_troubles": {},
    "record_lost": "",
    "machine": None,
    "folder": "runs/a",
}


def test_an_account_has_what_failed_where_by_how_much_and_how_to_run_it_again() -> None:
    assert account("bench/a b.toml", RAN, ("seed=2",)) == [
        "FAILED       y_e_m within ±0.01 from 5 s: found -0.0164 m (r2) at 5.01 s,"
        " margin -0.0064 m",
        "STOPPED r1: tick 3 (t = 0.006 s): no pose",
        "again   fleetloop run 'bench/a b.toml' --in-process --set seed=2",
        "run     runs/a",
    ]
    assert command("a.toml", RAN | {"processes": True}) == "fleetloop run a.toml"
    refused = of_error("a.toml", ScenarioError("a.toml: not a TOML file"))
    assert command("a.toml", refused, ("seed=2",)) == "fleetloop check a.toml --set seed=2"


def test_an_outcome_has_one_status() -> None:
    held = RAN | {"verdict": "held", "exit_status": 0}
    unchecked = RAN | {"verdict": "not checked"}
    outcomes = {
        "failed": RAN,
        "held": held,
        "skipped": unchecked | {"exit_status": 0, "expectations": []},
        "error": of_error("a", InfrastructureError("disk full")),
    }
    assert {status_of(outcome) for outcome in outcomes.values()} == set(outcomes)
    for status, outcome in outcomes.items():
        assert status_of(outcome) == status
    assert status_of(unchecked) == "failed"  # not reached
    assert status_of(unchecked | {"cut_short": {"r1": "at 2 s"}}) == "error"
    assert counts_of([RAN, RAN, held]) == {"failed": 2, "held": 1}
