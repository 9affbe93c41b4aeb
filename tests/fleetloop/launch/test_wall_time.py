"""What is said of runs that will take days."""

from configs.loading import load
from fleetloop.launch.wall_time import warning


def test_a_run_of_days_is_announced_and_others_are_not() -> None:
    assert warning(load("paper"), speed=0.0, in_process=False) is None
    slow = warning(load("paper"), speed=1e-5, in_process=False)
    assert slow is not None
    assert "34.7 days at 1e-05 × real time" in slow  # 30 s / 1e-5 is 3e6 s
    long = warning(load("paper", ("duration_s=1e7",)), speed=0.0, in_process=True)
    assert long is not None
    assert "days;" in long


def test_real_time_takes_as_long_as_it_is() -> None:
    week = load("realtime_100hz", ("duration_s=604800.0",))
    said = warning(week, speed=0.0, in_process=False)
    assert said is not None
    assert "about 7 days" in said
