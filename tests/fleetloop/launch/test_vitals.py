"""Signs of life: who froze is named once, and when it goes on."""

from fleetloop.launch.vitals import FROZEN_S, Vitals


def test_who_beats_is_well_and_who_stops_is_named_once() -> None:
    vitals = Vitals()
    for n in range(10):
        assert vitals.beat("agent/r1", n, 0.2 * n) is None
        assert vitals.newly_frozen(0.2 * n + 0.9 * FROZEN_S) == []
    (silence,) = vitals.newly_frozen(1.8 + 1.1 * FROZEN_S)
    assert (silence.process, silence.tick) == ("agent/r1", 9)
    assert vitals.newly_frozen(99.0) == []


def test_the_next_beat_ends_a_silence_and_tells_how_long_it_was() -> None:
    vitals = Vitals()
    vitals.beat("agent/r1", 1, 0.0)
    vitals.newly_frozen(2.0)
    silence = vitals.beat("agent/r1", 2, 3.5)
    assert (silence.tick, silence.lasted_s) == (1, 3.5)
    assert vitals.beat("agent/r1", 3, 3.6) is None


def test_who_never_beat_or_has_said_its_last_word_does_not_freeze() -> None:
    vitals = Vitals()
    vitals.beat("agent/r1", 1, 0.0)
    vitals.end("agent/r1")
    vitals.end("agent/r2")
    assert vitals.newly_frozen(99.0) == []
    assert vitals.silence("agent/r1", 4.0).lasted_s == 4.0
    assert vitals.silence("agent/r2", 4.0) is None
