"""Trials one after the other: closed-form optima, constraints, resumption, damage."""

from pathlib import Path

import pytest
from support.tunings import HEAD, PEAK, SEEDS, TINY, P, Told, bowl, plan_of

from bridge.process.lifecycle import Stop
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.tune.command import Search
from fleetloop.tune.evaluation import Evaluation, Here
from fleetloop.tune.scores import Trial
from fleetloop.tune.storage import FILE, alone, storage_of


def search(folder: Path, text: str, evaluation: Evaluation, stop: Stop | None = None) -> Search:
    """Do, or go on with, a tuning in a folder."""
    plan = plan_of(text)
    folder.mkdir(exist_ok=True)
    with storage_of(folder, plan.tuning) as storage:
        found = Search(folder, plan, storage, storage.done())
        found.go(evaluation, stop or Stop())
        return found


def more(text: str, trials: int) -> str:
    return text.replace("trials = 12", f"trials = {trials}")


def test_the_least_of_a_bowl_is_found(tmp_path: Path) -> None:
    best = search(tmp_path, more(TINY, 60), Told(bowl)).best
    assert best is not None
    assert best.values["p"] == pytest.approx(2.0, abs=0.4)
    assert best.values["q"] == pytest.approx(0.5, abs=0.4)
    assert best.score.objective < 0.1 < bowl({"p": 3.0, "q": 1.0}, 0)[0]


def test_the_first_trial_is_the_baseline_as_it_was_given(tmp_path: Path) -> None:
    text = more(TINY, 1).replace("baseline = 3.0", "baseline = 3.00000125")
    trial = search(tmp_path, text, Told(bowl)).trials[0]
    assert trial.values == {"p": 3.00000125, "q": 1.0}


def test_what_is_tried_follows_from_the_file_and_its_seed(tmp_path: Path) -> None:
    ours, theirs = Told(bowl), Told(bowl)
    search(tmp_path / "a", TINY, ours)
    search(tmp_path / "b", TINY, theirs)
    assert ours.asked == theirs.asked
    other = Told(bowl)
    search(tmp_path / "c", TINY.replace("trials = 12", "trials = 12\nseed = 2"), other)
    assert other.asked[0] == ours.asked[0]
    assert other.asked[1:] != ours.asked[1:]


@pytest.mark.parametrize("after", [0, 1, 5, 11])
def test_a_tuning_that_goes_on_tries_what_it_would_have_tried(tmp_path: Path, after: int) -> None:
    text = more(TINY, 14)
    whole = search(tmp_path / "whole", text, Told(bowl)).trials
    broken = search(tmp_path / "broken", text, Told(bowl, stops_after=after))
    assert len(broken.trials) == after
    assert broken.ended == "interrupted"
    assert search(tmp_path / "broken", text, Told(bowl)).trials == whole


def test_a_trial_that_was_killed_is_repeated(tmp_path: Path) -> None:
    whole = search(tmp_path / "whole", TINY, Told(bowl)).trials
    plan = plan_of(TINY)
    (tmp_path / "killed").mkdir()
    with storage_of(tmp_path / "killed", plan.tuning) as storage:
        storage.ask(0)  # and no word of it any more
    assert search(tmp_path / "killed", TINY, Told(bowl)).trials == whole


def test_more_trials_are_those_of_a_longer_tuning(tmp_path: Path) -> None:
    search(tmp_path / "grown", TINY, Told(bowl))
    grown = search(tmp_path / "grown", more(TINY, 20), Told(bowl)).trials
    assert grown == search(tmp_path / "long", more(TINY, 20), Told(bowl)).trials


def test_the_best_meets_every_constraint(tmp_path: Path) -> None:
    def steep(values, number):
        return float(values["p"]), "failed" if float(values["p"]) < 1.5 and number else "held"

    best = search(tmp_path, more(TINY, 40), Told(steep)).best
    assert best is not None
    assert best.score.feasible
    assert 1.5 <= best.values["p"] < 1.9
    allowed = more(TINY, 40) + '[[constraint]]\nquantity = "failure_rate"\nat_most = 0.5\n'
    best = search(tmp_path / "allowed", allowed, Told(steep)).best
    assert best is not None
    assert best.values["p"] < 1.0


def test_without_a_feasible_trial_the_best_misses_least(tmp_path: Path) -> None:
    text = TINY + '[[constraint]]\nquantity = "peak_x_e_m"\nat_most = -1.0\n'
    found = search(tmp_path, text, Told(bowl))
    best = found.best
    assert best is not None
    assert not best.score.feasible
    assert best.score.misses == min(trial.score.misses for trial in found.trials)


def test_values_that_were_tried_are_not_computed_again(tmp_path: Path) -> None:
    two = '[[parameter]]\nkey = "coordination.p"\nvalues = [1.0, 2.0]\nbaseline = 1.0\n'
    told = Told(lambda values, _: (float(values["p"]), "held"))
    found = search(tmp_path, HEAD + SEEDS + two + PEAK, told)
    assert len(found.trials) == 12
    assert len(told.asked) == 2


def test_gains_that_make_an_error_of_every_case_are_no_end(tmp_path: Path) -> None:
    found = search(tmp_path, TINY, Told(lambda *_: (None, "error")))
    assert len(found.trials) == 12
    assert found.best is not None
    assert found.best.number == 0
    assert found.best.score.objective is None


def test_a_start_on_the_path_is_found_by_real_runs(tmp_path: Path) -> None:
    """r1's error along its path is least if it starts where its path begins, at (3, 0)."""
    text = (
        HEAD.replace("trials = 12", "trials = 30")
        + '[[factor]]\nkey = "seed"\nvalues = [1]\n'
        + '[[parameter]]\nkey = "robot.r1.pose.y_m"\nuniform = [-1.0, 1.0]\nbaseline = 0.9\n'
        + '[objective]\nquantity = "start_error"\n'
        + '[[keep.quantity]]\nname = "start_error"\nstatistic = "peak"\nsignal = "x_e_m"\n'
        + 'robots = ["r1"]\n'
    )
    found = search(tmp_path, text, Here(kernel=False))
    values = {trial.values["y_m"]: trial.score.objective for trial in found.trials}
    assert found.best is not None
    assert abs(found.best.values["y_m"]) < 0.1
    assert values[0.9] > 0.5


@pytest.mark.parametrize("line", [b"\xff\x00", b"{}", b"17", b'{"op_code": '])
def test_a_damaged_journal_is_named_with_its_line(tmp_path: Path, line: bytes) -> None:
    search(tmp_path, TINY, Told(bowl))
    lines = (tmp_path / FILE).read_bytes().splitlines()
    lines[20] = line
    (tmp_path / FILE).write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(InfrastructureError, match=r"trials\.journal: damaged at line 21"):
        search(tmp_path, TINY, Told(bowl))


@pytest.mark.parametrize("cut", [1, 40, 400, 2000])
def test_a_journal_that_was_broken_off_goes_on(tmp_path: Path, cut: int) -> None:
    whole = search(tmp_path, TINY, Told(bowl)).trials
    path = tmp_path / FILE
    path.write_bytes(path.read_bytes()[:-cut])
    assert search(tmp_path, TINY, Told(bowl)).trials == whole


def test_a_folder_is_one_commands(tmp_path: Path) -> None:
    with (
        alone(tmp_path),
        pytest.raises(ScenarioError, match="another command is at work"),
        alone(tmp_path),
    ):
        pass


def test_importances_add_up_to_one_and_name_what_decides(tmp_path: Path) -> None:
    plan = plan_of(more(TINY, 40))
    with storage_of(tmp_path, plan.tuning) as storage:
        found = Search(tmp_path, plan, storage)
        found.go(Told(lambda values, _: (float(values["p"]), "held")), Stop())
        importances = storage.importances()
    assert sum(importances.values()) == pytest.approx(1.0)
    assert importances["p"] > importances["q"]


def test_a_single_parameter_has_no_importance(tmp_path: Path) -> None:
    plan = plan_of(HEAD + SEEDS + P + PEAK)
    with storage_of(tmp_path, plan.tuning) as storage:
        found = Search(tmp_path, plan, storage)
        found.go(Told(lambda values, _: (float(values["p"]), "held")), Stop())
        assert storage.importances() == {}
        assert all(isinstance(trial, Trial) for trial in storage.done())
