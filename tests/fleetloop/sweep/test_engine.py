"""The size of chunks, and what becomes of a chunk whose worker ended."""

from collections.abc import Iterator
from typing import Any

import pytest
from distributed import Client, LocalCluster
from hypothesis import given
from hypothesis import strategies as st
from support.studies import FEW, SHORT, P, cases_of

from bridge.process.lifecycle import Stop
from configs.errors import InfrastructureError
from fleetloop.sweep import engine as engines
from fleetloop.sweep.engine import CHUNK_S, FEW_CASES, LONGEST_S, MOST_CASES, Chunk, Engine, Pace
from fleetloop.sweep.work import Done

CASES = SHORT + 'design = "grid"\n' + P + '[[factor]]\nkey = "seed"\nintegers = [1, 4]\n' + FEW


def after(each_s: float, chunks: int = 12) -> Pace:
    """The pace after some chunks of cases that take so long each."""
    pace = Pace()
    for _ in range(chunks):
        pace.take(pace.size, Done(None, 0.0, pace.size * each_s, 1))
    return pace


@given(st.floats(1e-5, 100.0))
def test_a_chunk_takes_about_its_time_or_has_a_few_cases(each_s: float) -> None:
    size = after(each_s).size
    assert 1 <= size <= MOST_CASES
    if 1 < size < MOST_CASES and size > FEW_CASES:
        assert size * each_s <= CHUNK_S * 1.001
        assert (size + 1) * each_s > CHUNK_S * 0.999
    if size > 1:
        assert size * each_s <= max(CHUNK_S, LONGEST_S) * 1.001


@pytest.mark.parametrize(("each_s", "size"), [(0.25, 16), (0.01, 200), (3.0, 3), (60.0, 1)])
def test_a_task_has_sixteen_cases_unless_they_take_ten_seconds(each_s: float, size: int) -> None:
    assert after(each_s).size == size


def test_chunks_grow_step_by_step() -> None:
    assert [after(1e-4, chunks).size for chunks in range(5)] == [1, 4, 16, 64, 256]


def test_waits_are_counted_between_chunks_of_one_worker() -> None:
    pace = Pace()
    for began_s, process in ((0.0, 1), (0.0, 2), (1.5, 1), (1.0, 2)):
        pace.take(4, Done(None, began_s, began_s + 1.0, process))
    assert (pace.idle_s, pace.followed, pace.cases) == (0.5, 8, 16)


def test_halves_have_the_same_cases() -> None:
    one, other = Chunk((3, 4, 5)).halves()
    assert one.numbers + other.numbers == (3, 4, 5)
    assert one.numbers


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A client with two workers that are threads of this process."""
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):  # fmt: skip
        yield client


def test_every_case_comes_once_in_whatever_chunks(client: Any) -> None:
    came: list[int] = []

    def keep(batch: Any) -> bool:
        came.extend(batch.column("case").to_pylist())
        return False

    engine = Engine(client, cases_of(CASES), keep, lambda _: None, kernel=False)
    engine.compute(range(12), 12, Stop(), lambda: None)
    assert sorted(came) == list(range(12))
    assert engine.pace.cases == 12


def test_enough_is_enough(client: Any) -> None:
    came: list[int] = []

    def keep(batch: Any) -> bool:
        came.extend(batch.column("case").to_pylist())
        return True

    engine = Engine(client, cases_of(CASES), keep, lambda _: None, kernel=False)
    engine.compute(range(12), 12, Stop(), lambda: None)
    assert 1 <= len(came) < 12


def test_a_stop_is_heard(client: Any) -> None:
    stop = Stop()
    came: list[int] = []

    def keep(batch: Any) -> bool:
        came.extend(batch.column("case").to_pylist())
        stop.request("now")
        return False

    engine = Engine(client, cases_of(CASES), keep, lambda _: None, kernel=False)
    engine.compute(range(12), 12, stop, lambda: None)
    assert len(came) < 12


def test_a_cluster_without_workers_is_not_waited_for_without_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(engines, "NO_WORKER_S", 0.5)
    monkeypatch.setattr(engines, "COUNT_EVERY_S", 0.2)
    with (
        LocalCluster(
            n_workers=0, processes=False, dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):  # fmt: skip
        engine = Engine(client, cases_of(CASES), lambda _: False, lambda _: None, kernel=False)
        with pytest.raises(InfrastructureError, match=r"no worker for 0\.5 s"):
            engine.compute(range(12), 12, Stop(), lambda: None)
