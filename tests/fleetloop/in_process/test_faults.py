"""Faults in a formation: the faulty robot stops, arms again or goes on; nobody else notices."""

from functools import cache
from itertools import count, pairwise

import pytest
from support.in_process import RanInProcess

from configs.loading import load

FROM_S, FOR_S, ENDS_S = 1.0, 1.0, 5.0
STOPS, REARMS, GOES_ON = (
    ["drive_error", "stopped"],
    ["drive_error", "stopped", "rearming", "rearmed"],
    [],
)
SOUND = "first", "last"
COMMON = (
    "clock.mode='lockstep'",
    "clock.plant_step_s=0.005",
    f"duration_s={ENDS_S}",
    "expect=[]",
    "bus.record=[]",
    "host.rearm=true",
    "leader.speed_m_s=0.6",
    "coordination.v_hat_0=0.6",
)

LIMITED = {
    "drive_estop": (STOPS, 0.3, None),
    "drive_watchdog": (REARMS, 0.2, 0.05),
    "drive_reboot": (REARMS, 0.3, 0.05),
    "drive_error": (STOPS, 0.3, None),
    "torque_stuck": (GOES_ON, 0.0, 0.03),
    "torque_half": (GOES_ON, 0.08, 0.03),
    "torque_zero": (GOES_ON, 0.3, 0.2),
    "torque_reversed": (GOES_ON, 0.4, 1.05),
    "encoder_freeze": (GOES_ON, 0.3, 0.05),
    "encoder_sign_flip": (GOES_ON, 0.3, 0.3),
    "encoder_jump": (GOES_ON, 0.0, 0.03),
    "encoder_noise": (GOES_ON, 0.0, 0.03),
    "encoder_slip": (GOES_ON, 0.0, 0.03),
    "push": (GOES_ON, 0.0, 0.03),
    "payload": (GOES_ON, 0.0, 0.03),
    "friction": (GOES_ON, 0.2, 0.05),
    "wheel_radius": (GOES_ON, 0.03, 0.03),
    "wheel_slip": (GOES_ON, 0.1, 0.03),
    "localisation_bias": (GOES_ON, 0.06, 0.03),
    "localisation_jump": (GOES_ON, 0.0, 0.03),
    "localisation_drift": (GOES_ON, 0.0, 0.03),
}
REALISTIC = {
    "fet_over_temperature": (STOPS, 0.3, None),
    "motor_over_temperature": (STOPS, 0.3, None),
    "under_voltage": (STOPS, 0.3, None),
    "over_voltage": (STOPS, 0.3, None),
}
"""By kind: what its controller does; how far from its reference the robot gets at least, and how
near it is at the end [m]."""
INSTANTS = {kind for kind in LIMITED if kind.startswith("drive_") or kind.endswith("_jump")}
OF_ROBOTS = {"push", "payload", "wheel_radius", "under_voltage", "over_voltage"}


def entry(kind: str) -> str:
    keys = [f'kind="{kind}"', f"at_s={FROM_S}", f'robots=["{kind}"]']
    keys += [] if kind in INSTANTS else [f"for_s={FOR_S}"]
    keys += [] if kind in OF_ROBOTS or kind.startswith("localisation") else ['wheel="left"']
    return f"{{{', '.join(keys)}}}"


def fleet(kinds: list[str], preset: str, *, faulty: bool) -> RanInProcess:
    """A robot for each kind in a chain between two sound ones, all on their paths already."""
    names = [SOUND[0], *kinds, SOUND[1]]
    robots = [
        f'{{name="{name}", pose={{x_m=3.0, y_m=0.0, theta_rad=1.5707963}}, v_m_s=0.6,'
        f" omega_rad_s=0.2}}"
        for name in names
    ]
    edges = [f'"{one} -> {other}"' for one, other in pairwise(names)]
    faults = [entry(kind) for kind in kinds] if faulty else []
    return RanInProcess(
        load(
            "two_robots_100hz",
            (
                *COMMON,
                f"drive.preset='{preset}'",
                f"robot=[{', '.join(robots)}]",
                f"graph={{edges=[{', '.join(edges)}], leader=['first']}}",
                f"fault=[{', '.join(faults)}]",
            ),
        )
    )


@cache
def ran(preset: str, faulty: bool = True) -> RanInProcess:
    kinds = {"limited": LIMITED, "realistic": REALISTIC}[preset]
    return fleet(list(kinds), preset, faulty=faulty)


CASES = [
    pytest.param(preset, kind, *outcome, id=kind)
    for preset, kinds in (("limited", LIMITED), ("realistic", REALISTIC))
    for kind, outcome in kinds.items()
]


@pytest.mark.parametrize(("preset", "kind", "does", "away_m", "back_m"), CASES)
def test_a_robot_under_a_fault_stops_or_arms_again_or_goes_on_and_comes_back(
    preset: str, kind: str, does: list[str], away_m: float, back_m: float | None
) -> None:
    run, sound = ran(preset), ran(preset, faulty=False)
    assert run.events_of(kind) == ["armed", *does]
    begun, over = round(100 * FROM_S), round(100 * (FROM_S + FOR_S))
    moved, would = (one.truth(kind)["v_m_s"] for one in (run, sound))
    assert moved[: begun + 1] == would[: begun + 1]
    assert moved[begun:over] != would[begun:over]
    away = run.distance(kind)
    assert max(away[begun - 20 : begun]) < 0.03
    assert max(away[begun:]) >= away_m
    if back_m is None:
        assert moved[-1] == pytest.approx(0.0, abs=0.05)
        assert set(run.truth(kind)["demand_right_wheel_N_m"][over:]) == {0.0}
    else:
        assert max(away[-10:]) < back_m
        assert away[-1] < max(away[-51], 0.05)


@pytest.mark.parametrize("preset", ["limited", "realistic"])
def test_path_variables_and_sound_robots_are_as_without_the_faults_of_others(preset: str) -> None:
    faulty, sound = ran(preset), ran(preset, faulty=False)
    for robot in SOUND:
        for source in ("plant", "controller"):
            assert faulty.rows[robot, source] == sound.rows[robot, source]
    for robot, source in faulty.rows:
        if source == "controller":
            for signal in ("s", "v_r_hat"):
                assert faulty.controller(robot)[signal] == sound.controller(robot)[signal]


def test_fifty_faults_at_once_end_in_a_record_and_always_in_the_same() -> None:
    number = count()
    kinds = [*LIMITED, *REALISTIC]
    faults = []
    for kind in kinds * 2:
        n = next(number)
        faults.append(entry(kind).replace(f'robots=["{kind}"]', f'name="f{n}"'))
    assert len(faults) == 50
    runs = [
        RanInProcess(
            load(
                "two_robots_100hz",
                (
                    *COMMON,
                    "drive.preset='realistic'",
                    "until_s=1.5",
                    f"fault=[{', '.join(faults)}]",
                ),
            )
        ).rows
        for _ in range(3)
    ]
    assert runs[0] == runs[1] == runs[2]
    assert all(runs[0].values())
