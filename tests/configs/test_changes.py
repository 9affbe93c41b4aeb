"""Changes of a loaded scenario from a program: what they reach, and what is said of wrong ones."""

import pickle

import numpy as np
import pytest
from support.scenario_text import SMALL, changed

from configs.errors import ScenarioError
from configs.loading import load, loads
from configs.scenario import Scenario

CIRCLE = {"kind": "circle", "radius_m": 3.0}
PUSH = '[[fault]]\nkind = "push"\nname = "shove"\nrobots = ["r1"]\nat_s = 1.0\nfor_s = 0.5\n'


@pytest.fixture(scope="module")
def small() -> Scenario:
    return loads("small.toml", SMALL)


def test_a_table_is_changed_key_by_key_and_the_old_scenario_stays(small: Scenario) -> None:
    made = small.with_(control={"k1": 3.0}, duration_s=2.5)
    assert made.control.parameters.k1 == 3.0
    assert made.control.parameters.k2 == small.control.parameters.k2
    assert (made.duration_s, small.duration_s) == (2.5, loads("f", SMALL).duration_s)


def test_dotted_keys_and_tables_say_the_same(small: Scenario) -> None:
    dotted = small.with_({"robot.r2.pose.x_m": -6.5, "coordination.p": 3.0})
    assert dotted == small.with_(robot={"r2": {"pose": {"x_m": -6.5}}}, coordination={"p": 3.0})
    assert dotted == small.with_(**{"robot.1.pose.x_m": -6.5}, coordination={"p": 3.0})
    assert dotted == loads("f", SMALL, ("robot.r2.pose.x_m=-6.5", "coordination.p=3.0"))
    assert (dotted.robot[1].pose.x_m, dotted.robot[0]) == (-6.5, small.robot[0])


def test_changes_add_up(small: Scenario) -> None:
    made = small.with_(seed=7).with_(until_s=1.5).with_(until_s=None)
    assert (made.seed, made.until_s) == (7, None)
    assert made == small.with_(seed=7)


def test_a_table_of_another_kind_replaces_one_of_the_same_does_not(small: Scenario) -> None:
    circle = small.with_(path=CIRCLE | {"centre_m": [1.0, 2.0]})
    assert circle.path.kind == "circle"
    larger = circle.with_(path={"kind": "circle", "radius_m": 4.0})
    assert (larger.path.radius_m, larger.path.centre_m) == (4.0, (1.0, 2.0))


def test_lists_are_replaced_and_lose_members_by_name() -> None:
    pushed = loads("f", SMALL + PUSH)
    assert pushed.with_(fault={"shove": {"at_s": 2.0}}).fault[0].at_s == 2.0
    assert pushed.with_(fault={"shove": None}) == pushed.with_(fault=[]) == loads("f", SMALL)
    twice = pushed.with_(fault=(*pushed.fault, {"kind": "push", "name": "again", "at_s": 2.0}))
    assert [fault.name for fault in twice.fault] == ["shove", "again"]


def test_sections_and_numbers_of_numpy_are_taken_as_what_they_are(small: Scenario) -> None:
    assert small.with_(clock=small.clock, localisation=small.localisation) == small
    offset = np.array([0.5, 1.0])
    made = small.with_({"coordination.p": np.int64(3), "seed": np.uint8(4)}, path=CIRCLE)
    assert (made.coordination.p, made.seed) == (3.0, 4)
    assert made.with_({"path.centre_m": offset}).path.centre_m == (0.5, 1.0)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"control": {"k1": -3.0}}, "control.k1 = -3.0: must be greater than 0"),
        ({"until_s": "5"}, "until_s = '5': must be a number"),
        ({"robot": {"r9": {"v_m_s": 1}}}, "robot.r9.v_m_s = 1: no 'r9' there; known: r1, r2"),
        ({"robot": {"r9": None}}, "robot.r9 = None: r9 names nothing there; known: r1, r2"),
        ({"name.x": 1}, "name.x = 1: x names nothing there"),
        ({"path": CIRCLE | {"r": 1}}, "unknown key"),
        (
            {"control": {"name": "fixed_dsc"}},
            "control.name = 'fixed_dsc': unknown key; did you mean law? (known here: law, eta,",
        ),
        ({"contrl": {"k1": 3.0}}, 'small.toml: contrl = {"k1": 3.0}: unknown key; did you mean'),
        ({"graph": {"edges": ["r1 -> r7"]}}, "graph.edges = ['r1 -> r7']: r7: no such robot"),
    ],
)
def test_what_is_wrong_is_named_with_its_value_and_what_would_be_right(
    small: Scenario, changes: dict[str, object], line: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        small.with_(changes)
    assert line in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "sections", "line"),
    [
        ({"seed": 3}, {"seed": 4}, "seed: changed twice, to 3 and 4: name it once"),
        (
            {"control.k1": 1.0, "control": {"k1": 2.0}},
            {},
            "control.k1: changed twice, to 1.0 and 2.0: name it once",
        ),
    ],
)
def test_a_key_is_changed_once(
    small: Scenario, changes: dict[str, object], sections: dict[str, object], line: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        small.with_(changes, **sections)
    assert str(caught.value) == line


@pytest.mark.parametrize(
    "name", ["paper", "realistic", "switching", "moving_leader", "lossy_chain"]
)
def test_sections_may_be_given_back_as_they_are(name: str) -> None:
    scenario = load(name)
    for key, field in type(scenario).model_fields.items():
        again = scenario.with_({field.alias or key: getattr(scenario, key)})
        assert again == scenario, key


def test_a_robot_is_added_to_those_that_are_there(small: Scenario) -> None:
    first = small.robot[0]
    third = {"name": "r3", "pose": first.pose, "offset": first.offset}
    grown = small.with_({"graph.edges": ["r1 -> r2", "r2 -> r3"]}, robot=[*small.robot, third])
    assert grown.names == ("r1", "r2", "r3")
    assert grown.robot[:2] == small.robot
    assert grown.robot[2].pose == first.pose


def test_a_key_is_a_text(small: Scenario) -> None:
    with pytest.raises(TypeError, match=r"a key is a text, as 'control\.k1'"):
        small.with_({3: 4})


def test_all_that_is_wrong_comes_at_once(small: Scenario) -> None:
    with pytest.raises(ScenarioError) as caught:
        small.with_(seed=-1, control={"k1": "x", "k2": -1.0})
    assert len(str(caught.value).splitlines()) == 3


def test_a_scenario_that_is_from_no_file_is_changed_with_its_defaults(small: Scenario) -> None:
    copied = small.model_copy(update={"seed": 5})
    assert copied.origin is None
    assert copied.with_(until_s=1.0) == small.with_(seed=5, until_s=1.0)


def test_origin_is_no_part_of_a_scenario(small: Scenario) -> None:
    other = loads("another.toml", small.to_toml())
    assert other.origin != small.origin
    assert other.topology.edges  # made once, and kept beside the fields as origin is
    assert other == small
    assert other != small.with_(seed=3)
    assert pickle.loads(pickle.dumps(small)).with_(seed=3) == small.with_(seed=3)


def test_laws_of_the_users_own_are_found_beside_the_file_again(tmp_path) -> None:
    (tmp_path / "gentle_law.py").write_text(
        "from agents.laws.fixed_dsc import FixedDsc\n\n\nclass Gentle(FixedDsc):\n    pass\n"
    )
    file = tmp_path / "own.toml"
    file.write_text(changed(SMALL, "control.law='gentle_law:Gentle'"))
    assert load(file).with_(control={"k1": 2.0}).control.name == "gentle_law:Gentle"


def test_a_scenario_shows_itself_in_one_line(small: Scenario) -> None:
    assert repr(small) == (
        "Scenario('small', robots=2, law='adaptive_dsc', until_s=30.0, clock='lockstep', seed=1)"
    )


def test_parameters_of_a_law_are_read_as_they_are_changed(small: Scenario) -> None:
    control = small.with_(control={"k1": 3.0}).control
    assert (control.k1, control.parameters.k1) == (3.0, 3.0)
    assert "k1" in dir(control)
    assert repr(control).startswith("adaptive_dsc: AdaptiveDscGains(k1=3.0, ")
    assert pickle.loads(pickle.dumps(control)) == control
    with pytest.raises(AttributeError, match="k9"):
        control.k9  # noqa: B018


def test_changes_are_keys_and_values(small: Scenario) -> None:
    with pytest.raises(TypeError, match="keys and values, as"):
        small.with_("control.k1=3.0")
