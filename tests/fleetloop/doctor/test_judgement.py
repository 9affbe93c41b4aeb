"""Judgements of a machine: each level has a cause, and what isn't ok a remedy."""

import pytest

from fleetloop.check.finding import Finding
from fleetloop.doctor import judgement
from fleetloop.doctor.judgement import WakeUps


def late(*micros: float, count: int = 1000) -> WakeUps:
    """As many wake-ups as that; the last ones are this late, the others 10 µs."""
    rest = [10e-6] * (count - len(micros))
    return WakeUps(sorted([*rest, *(it * 1e-6 for it in micros)]), 0.001)


def test_quantiles_are_those_of_what_was_measured() -> None:
    measured = WakeUps([0.001 * n for n in range(1, 101)], 0.001)
    assert measured.quantile_s(0.5) == pytest.approx(0.050)
    assert measured.quantile_s(0.99) == pytest.approx(0.099)
    assert measured.missed(0.0905) == 10
    assert WakeUps([0.5], 1.0).quantile_s(0.99) == 0.5


@pytest.mark.parametrize(
    "measured, held",
    [
        (late(), "1000 Hz"),
        (late(900), "1000 Hz"),  # one of a thousand is no rule, as long as none is a period late
        (late(1100), "500 Hz"),
        (late(*[400] * 20), "500 Hz"),
        (late(*[600] * 20), "200 Hz"),
        (late(9_000), "100 Hz"),
        (late(19_000), "50 Hz"),
        (late(21_000), "less than 50 Hz"),
    ],
)
def test_the_rate_is_the_highest_whose_quarter_period_holds_99_of_100(measured, held) -> None:
    found = judgement.wake_ups(measured, realtime=True, rate_hz=None)
    assert found.value.endswith(held)
    assert found.level == ("warning" if held.startswith("less") else "ok")


@pytest.mark.parametrize(
    "measured, level",
    [(late(), "ok"), (late(*[400] * 20), "warning"), (late(*[1500] * 20), "error")],
)
def test_a_rate_that_is_asked_for_is_judged(measured, level) -> None:
    found = judgement.wake_ups(measured, realtime=False, rate_hz=1000.0)
    assert (found.level, found.limit) == (level, "p99 <= 250 µs, none above 1 ms")
    assert ("SCHED_FIFO (below)" in found.remedy) is (level != "ok")


def level_of(finding: Finding | None) -> str:
    assert finding is not None
    assert bool(finding.remedy) or finding.level == "ok"
    return finding.level


@pytest.mark.parametrize(
    "finding, level",
    [
        (judgement.priority(True, 0, processors=2), "ok"),
        (judgement.priority(False, 0, processors=2), "warning"),
        (judgement.priority(False, 0, processors=1), "ok"),
        (judgement.memory_locking(8 << 20, root=False), "warning"),
        (judgement.memory_locking(8 << 20, root=True), "ok"),
        (judgement.memory_locking(-1, root=False), "ok"),
        (judgement.memory_locking(2 << 30, root=False), "ok"),
        (judgement.processors(1, 0.0), "warning"),
        (judgement.processors(4, 3.5), "warning"),
        (judgement.processors(4, 0.5), "ok"),
        (judgement.governor("powersave"), "warning"),
        (judgement.governor("performance"), "ok"),
        (judgement.clock_source("hpet"), "warning"),
        (judgement.clock_source("tsc"), "ok"),
        (judgement.clock_source(None), "ok"),
        (judgement.kernel("5.2.1-generic", preempt_rt=False), "error"),
        (judgement.kernel("6.8.0-45-generic", preempt_rt=True), "ok"),
        (judgement.kernel("10.0", preempt_rt=False), "ok"),
        (judgement.loopback(""), "ok"),
        (judgement.loopback("can't listen"), "error"),
        (judgement.sockets_folder("/tmp/fl", ""), "ok"),
        (judgement.sockets_folder("/tmp/fl", "no"), "error"),
        (judgement.socket_path(len("/run/user/1000/fleetloop"), 107), "ok"),
        (judgement.socket_path(50, 107), "warning"),
        (judgement.socket_path(70, 107), "error"),
        (judgement.open_files(-1), "ok"),
        (judgement.open_files(1 << 19), "ok"),
        (judgement.open_files(512), "warning"),
        (judgement.open_files(70), "error"),
        (judgement.scouting(), "ok"),
        (judgement.can_interfaces([], [], registered=True), "ok"),
        (judgement.can_interfaces(["can0"], ["can"], registered=True), "ok"),
        (judgement.can_interfaces(["can0"], ["can"], registered=False), "error"),
        (judgement.versions([("Python", "3.11.7")], "compiled"), "ok"),
        (judgement.packages(""), "ok"),
        (judgement.leftovers([], []), "ok"),
        (judgement.leftovers(["a", "b"], []), "ok"),
        (judgement.leftovers([], [(12, "agent r1")]), "warning"),
        (judgement.disk("/home/me", 3 << 30), "ok"),
        (judgement.disk("/home/me", 1 << 30), "warning"),
        (judgement.disk("/home/me", 1 << 20), "error"),
        (judgement.disk("/home/me", None), "error"),
    ],
)
def test_each_judgement_has_its_levels_and_a_remedy_for_what_is_not_ok(finding, level) -> None:
    assert level_of(finding) == level


def test_what_the_kernel_does_not_say_is_not_judged() -> None:
    assert judgement.governor(None) is None


def test_a_foreign_package_says_itself_what_to_do() -> None:
    assert judgement.packages("the package 'agents' ... is not Fleetloop's own").level == "error"


def test_left_over_processes_are_named_with_what_ends_them() -> None:
    found = judgement.leftovers(["old"], [(12, "agent r1"), (13, "plant")])
    assert found.value == "sockets of old; on their own: agent r1 (12), plant (13)"
    assert found.remedy.endswith("kill 12 13")


def test_the_room_for_names_is_what_a_path_of_a_socket_has() -> None:
    base, most = "/tmp/fl", 107
    left = int(judgement.socket_path(len(base), most).value.split()[0])
    path = f"{base}/20261127-084500-{'s' * (left - 2)}-123456/r1.can"
    assert len(path) == most


def test_versions_say_whether_it_is_compiled() -> None:
    installed = [("fleetloop", "0.1.0"), ("Python", "3.11.7")]
    assert judgement.versions(installed, "pure Python: so").value == (
        "fleetloop 0.1.0, Python 3.11.7; pure Python: so"
    )
