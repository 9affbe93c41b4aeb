"""What the edges did: counts from reports, ages from the record."""

import numpy as np

from fleetloop.results.network import network
from fleetloop.results.tables import MOST_EDGES, network_lines


def rows(**columns: list[float]) -> np.ndarray:
    made = np.zeros(len(next(iter(columns.values()))), [(name, "<f8") for name in columns])
    for name, values in columns.items():
        made[name] = values
    return made


def test_an_edge_has_its_counts_and_the_age_of_its_data() -> None:
    ages = [np.nan, *np.linspace(0.0, 1.0, 101)]
    controllers = {"r1": rows(s=[0.0]), "r2": rows(s=[0.0] * 102, age_of_r1_s=ages)}
    edges = network(controllers, {"r2": {"r1": {"sent": 5, "lost": 2}, "leader": {"sent": 7}}})
    assert edges == {
        "r1 -> r2": {"sent": 5, "lost": 2, "age_s": {"mean": 0.5, "p99": 0.99, "max": 1.0}},
        "leader -> r2": {"sent": 7},
    }


def test_edges_are_in_the_order_of_names_whichever_controller_reports_first() -> None:
    counts = {"sent": 1}
    edges = network({}, {"r2": {"r1": counts, "leader": counts}, "r1": {"r2": counts}})
    assert list(edges or ()) == ["leader -> r2", "r1 -> r2", "r2 -> r1"]


def test_an_edge_that_carried_nothing_has_no_age() -> None:
    controllers = {"r2": rows(age_of_r1_s=[np.nan, np.nan])}
    assert network(controllers, {}) == {"r1 -> r2": {"age_s": None}}


def test_without_emulation_or_ages_there_is_nothing_to_say() -> None:
    assert network({"r1": rows(s=[0.0])}, {}) is None


def test_lines_tell_of_the_edges_with_the_oldest_data_first() -> None:
    age = {"mean": 0.1, "p99": 0.2, "max": 0.3}
    edges = {f"r{n} -> r0": {"age_s": age | {"max": 0.1 * n}} for n in range(1, 11)}
    edges["leader -> r0"] = {"sent": 5, "delivered": 3, "lost": 2, "late": 0}
    lines = list(network_lines({"network": edges}))
    assert lines[0] == "r10 -> r0: age 0.1 s, p99 0.2 s, max 1 s"
    assert lines[-1] == f"and {11 - MOST_EDGES} more edges in summary.json"
    alone = network_lines({"network": {"leader -> r0": edges["leader -> r0"]}})
    assert list(alone) == ["leader -> r0: 5 sent, 3 delivered, 2 lost"]
