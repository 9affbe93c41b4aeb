"""When controllers' processes are absent, and faults of processes that can't act."""

import pytest
from support.robot_bench import NOWHERE
from support.scenario_text import SMALL, problems

from configs.faults.absences import Absence, absences
from configs.faults.plan import planned_faults
from configs.loading import load
from configs.resolve import plant_brief

KILL = '{kind="process_kill", at_s=1.0, for_s=0.5, robots=["r2"]}'
FREEZE = '{kind="process_freeze", at_s=1.0, for_s=0.5, robots=["r2"]}'
RESTART = '{kind="process_restart", at_s=2.0, robots=["r1"]}'
DROP, REALTIME = "clock.on_late='drop'", "clock.mode='realtime'"


def absent(*faults: str, overrides: tuple[str, ...] = (DROP,)) -> tuple[Absence, ...]:
    scenario = load("two_robots", (f"fault=[{', '.join(faults)}]", *overrides))
    return absences(planned_faults(scenario), 2000)


def test_an_absence_lasts_from_the_tick_of_the_fault_to_the_tick_of_its_end() -> None:
    assert absent(KILL, RESTART) == (
        Absence("process_kill", "r2", 500, 750, frozen=False),
        Absence("process_restart", "r1", 1000, 1001, frozen=False),
    )
    assert absent(FREEZE) == (Absence("process_freeze", "r2", 500, 750, frozen=True),)
    for_good = '{kind="process_kill", at_s=1.0, robots=["r1"]}'
    beyond = '{kind="process_freeze", at_s=1.0, for_s=9.0, robots=["r2"]}'
    assert [one.to_tick for one in absent(for_good, beyond)] == [None, None]
    assert absent('{kind="process_slow", at_s=1.0}', '{kind="push", at_s=1.0}') == ()


def test_the_plant_is_told_in_lockstep_alone() -> None:
    told = [
        plant_brief(load("two_robots", (f"fault=[{KILL}]", one)), network=NOWHERE)
        for one in (DROP, REALTIME)
    ]
    assert [len(brief.absences) for brief in told] == [1, 0]
    assert [brief.schedule.on_late for brief in told] == ["drop", "abort"]


@pytest.mark.parametrize(
    ("fault", "more", "remedy"),
    [
        ('kind = "process_kill"\nat_s = 1.0\nfor_s = 0.5', "", "needs clock.on_late = 'hold' or"),
        ('kind = "process_freeze"\nat_s = 1.0\nfor_s = 0.5', "", "needs clock.on_late = 'hold'"),
        ('kind = "process_restart"\nat_s = 1.0', "", "ends a lockstep run: needs clock.on_late"),
        (
            'kind = "process_restart"\nat_s = 1.0',
            '[clock]\non_late = "drop"\n[localisation]\nsource = "odometry"\n',
            "odometry alone doesn't know where the robot is",
        ),
        (
            'kind = "process_kill"\nat_s = 1.0\n[[fault]]\nkind = "process_freeze"\nat_s = 1.5',
            "",
            "is absent from 1 s on, and can't be killed or frozen then",
        ),
    ],
)
def test_a_process_fault_that_cannot_act_is_refused_with_the_reason(
    fault: str, more: str, remedy: str
) -> None:
    text = SMALL.replace("[[robot]]", f"{more}\n[[robot]]", 1)
    assert remedy in "\n".join(map(str, problems(f"{text}\n[[fault]]\n{fault}\n")))


def test_what_ends_a_lockstep_run_may_be_asked_for() -> None:
    stays = '{kind="process_freeze", at_s=1.0, robots=["r2"]}'
    assert len(absent(stays, overrides=())) == 1
