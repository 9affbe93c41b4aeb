"""What is said to `can.Bus(...)`, as programs and as python-can's configuration files say it."""

from math import inf, nan

import can
import pytest

from bridge.can_bus import options


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({}, "channel = None: must be a bus"),
        ({"channel": ""}, "channel = '': must be a bus"),
        ({"channel": " "}, "channel = ' ': must be a bus"),
        ({"channel": ["r1"]}, "channel = "),
        ({"channel": b"r1"}, "channel = "),
        ({"channel": "/a\0b"}, "bus '/a"),
        ({"channel": "/" + "x" * 200}, "AF_UNIX path too long"),
        ({"channel": "r1", "synchronous": 3}, "synchronous = 3: must name the robot"),
        ({"channel": "r1", "synchronous": True}, "synchronous = True: must name the robot"),
        (
            {"channel": "r1", "synchronous": "r1", "secret": 5},
            "synchronous = 'r1': must name the robot",
        ),
        ({"channel": "r1", "batched": 3}, "batched = 3: must be true or false"),
        ({"channel": "r1", "batched": "maybe"}, "batched = 'maybe': must be true or false"),
        ({"channel": "r1", "receive_own_messages": []}, "receive_own_messages = "),
        ({"channel": "r1", "fd": "true"}, "is classic CAN: fd must be False"),
        *(
            ({"channel": "r1", "connect_timeout": value}, f"connect_timeout = {value!r}: must be a")
            for value in ("x", "", None, True, 0, -1.0, nan, inf, [1])
        ),
    ],
)
def test_a_wrong_value_is_an_initialization_error_that_names_it(
    runtime_folder, wrong: dict[str, object], told: str
) -> None:
    with pytest.raises(can.CanInitializationError) as caught:
        can.Bus(interface="fleetloop", **wrong)
    assert told in str(caught.value)


def test_an_unknown_option_is_named_and_answered_with_those_that_there_are(runtime_folder) -> None:
    with pytest.raises(TypeError, match=r"has no option speed \(it has batched, .*, users\)"):
        can.Bus(interface="fleetloop", channel="r1", speed=3)


@pytest.mark.parametrize(
    ("said", "meant"),
    [("True", True), ("no", False), ("1", True), (0, False), (None, False), ("", False)],
)
def test_truths_may_be_texts_of_a_configuration_file(said: object, meant: bool) -> None:
    assert options.truth("batched", said) is meant


def test_times_may_be_texts_and_are_cut_to_what_a_kernel_can_wait() -> None:
    assert options.seconds("connect_timeout", "2.5") == 2.5
    assert options.seconds("connect_timeout", 10**300) == options.LONGEST_S
