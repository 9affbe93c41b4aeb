"""What a law tells of itself, and what it may leave out."""

from math import inf
from types import SimpleNamespace

from fleetloop.check.law import approach_rate_1_s, speed_gain, torque_limit_wheel_N_m


def choice_of(law: type) -> SimpleNamespace:
    return SimpleNamespace(load=lambda: law, parameters=None)


class Silent:
    """Tells nothing."""


class Unknowing:
    """Tells that nothing is known."""

    @classmethod
    def torque_limit_wheel_N_m(cls, _gains) -> None:
        return None

    approach_rate_1_s = speed_gain_N_m_s = torque_limit_wheel_N_m


def test_a_law_that_tells_nothing_and_one_that_tells_none_are_alike() -> None:
    for law in (Silent, Unknowing):
        control = choice_of(law)
        assert torque_limit_wheel_N_m(control) == inf
        assert approach_rate_1_s(control) is None
        assert speed_gain(control) is None
