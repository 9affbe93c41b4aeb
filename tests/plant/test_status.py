"""Rates and loads of a plant's buses, from one word to the next."""

from types import SimpleNamespace

from support.clocks import ManualClock

from bridge.network.messages import Progress
from plant.status import Narrator, PlantMeter


def bus(now_ns: int = 0, crossed: int = 0, busy_ns: int | None = 0) -> SimpleNamespace:
    return SimpleNamespace(now_ns=now_ns, crossed=crossed, busy_ns=busy_ns)


def test_rate_and_load_are_of_the_time_since_the_last_status() -> None:
    one = bus()
    meter = PlantMeter({"r1": one}, ())
    one.now_ns, one.crossed, one.busy_ns = 10**9, 100, 4 * 10**8
    assert meter.status().buses == (("r1", 100, 100.0, 0.4),)
    one.now_ns, one.crossed, one.busy_ns = 3 * 10**9, 900, 5 * 10**8
    assert meter.status().buses == (("r1", 900, 400.0, 0.05),)


def test_while_bus_time_stands_still_the_last_rates_stay() -> None:
    one = bus()
    meter = PlantMeter({"r1": one}, ())
    one.now_ns, one.crossed, one.busy_ns = 10**9, 100, 4 * 10**8
    assert meter.status() == meter.status()


def test_a_bus_without_bit_timing_has_no_load() -> None:
    one = bus(busy_ns=None)
    meter = PlantMeter({"r1": one}, ())
    one.now_ns, one.crossed = 10**9, 100
    assert meter.status().buses == (("r1", 100, 100.0, None),)


def test_a_status_goes_with_the_progress_that_comes_when_it_is_due() -> None:
    clock = ManualClock(10**9)
    said: list[Progress | None] = []
    progress = SimpleNamespace(put=lambda payload: said.append(Progress.decode(payload)))
    narrator = Narrator(progress, 1.0, clock=clock)
    narrator.say(Progress(0, 0, 0))
    narrator.meter = PlantMeter({"r1": bus()}, ())
    for _ in range(20):
        narrator.say(Progress(1, 0, 0))
        clock.sleep(0.1)
    with_status = [n for n, it in enumerate(said) if it is not None and it.status is not None]
    assert len(said) == 21
    assert with_status[0] == 1
    assert 2 <= len(with_status) <= 3
