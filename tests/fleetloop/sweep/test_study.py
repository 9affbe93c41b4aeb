"""Study files: what is read, and what is refused in terms of the file."""

import pytest
from support.studies import FEW, MASS, SHORT, P, cases_of

from configs.errors import ScenarioError
from fleetloop.sweep import study as studies
from fleetloop.sweep.study import json_schema, loads, shipped

GRID = SHORT + 'design = "grid"\n'
RANDOM = SHORT + 'design = "random"\ncases = 8\n'


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_study_loads_and_its_first_and_last_case_are_valid(name: str) -> None:
    from fleetloop.sweep.cases import Cases
    from fleetloop.sweep.plan import Plan

    cases = Cases(Plan.of(name))
    for number in (0, cases.study.total - 1):
        cases.scenario(cases.case(number))


def test_a_study_written_out_is_the_same_study() -> None:
    study = loads("study.toml", RANDOM + MASS + P + "[stop]\nbudget_s = 60.0\n")
    assert loads("study.toml", study.to_toml()) == study


def test_its_title_is_its_files_name_if_none_is_given() -> None:
    text = RANDOM.replace('title = "short"\n', "") + MASS
    assert loads("folder/masses.toml", text).title == "masses"


def test_a_grid_has_the_product_of_its_levels_or_fewer() -> None:
    seeds = '[[factor]]\nkey = "seed"\nintegers = [1, 4]\n'
    assert loads("s.toml", GRID + P + seeds).total == 12
    assert loads("s.toml", GRID + P + seeds, {"cases": 5}).total == 5
    assert loads("s.toml", GRID + P + seeds, {"cases": 99}).total == 12


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (RANDOM, "study.toml: factor"),
        (RANDOM + '[[factor]]\nkey = "seed"\n', "one of values, range, integers"),
        (
            RANDOM + MASS.replace("[1.0, 4.0]", "[4.0, 1.0]"),
            "factor.mass_kg.uniform = [4.0, 1.0]: the range is empty: its end must be above 4",
        ),
        (RANDOM + MASS.replace("[1.0, 4.0]", "[2.0, 2.0]"), "the range is empty"),
        (
            RANDOM + '[[factor]]\nkey = "seed"\nintegers = [3, 2]\n',
            "the range is empty: its end must be at least 3",
        ),
        (RANDOM + '[[factor]]\nkey = "seed"\nvalues = []\n', "must have 1 entries or more"),
        (
            RANDOM + '[[factor]]\nkey = "a.b"\nrange = { least = 1.0, most = 1.0, steps = 3 }\n',
            "range.most = 1.0: the range is empty: must be above least = 1",
        ),
        (
            RANDOM + '[[factor]]\nkey = "a.b"\nlog_uniform = [0.0, 1.0]\n',
            "must be greater than 0",
        ),
        (
            RANDOM + '[[factor]]\nkey = "a.b"\nuniform = [0.0, 1.0]\nvalues = [1.0]\n',
            "one of values, range, integers, graph, uniform, log_uniform, normal,"
            " not values and uniform",
        ),
        (RANDOM + "[[factor]]\nuniform = [0.0, 1.0]\n", "give key, or keys"),
        (RANDOM + '[[factor]]\nkey = "graph"\ngraph = {}\n', "leave out key"),
        (RANDOM + MASS + MASS, "factor 0 has it already"),
        (
            RANDOM + '[[factor]]\nname = "verdict"\nkey = "seed"\nintegers = [1, 2]\n',
            "is a column of every dataset",
        ),
        (GRID + MASS, 'factor.mass_kg.uniform = "mass_kg": has no levels for a grid'),
        (SHORT + 'design = "sobol"\n' + MASS, "cases = (missing): must be given"),
        (RANDOM.replace("random", "cube") + MASS, "design = \"cube\": must be 'grid', 'random'"),
        (RANDOM.replace("cases", "casses") + MASS, "unknown key; did you mean cases?"),
        (GRID + P + "[stop]\nfailure_rate_within = 0.1\n", "the points of a grid are none"),
        ("schema = 1\nbase = ", "not a TOML file"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(text: str, said: str) -> None:
    with pytest.raises(ScenarioError) as found:
        loads("study.toml", text)
    assert said in str(found.value)


def test_an_option_is_named_where_it_is_at_fault() -> None:
    with pytest.raises(ScenarioError, match="--cases 0: must be 1 or more"):
        loads("study.toml", RANDOM + MASS, {"cases": 0})


def test_no_such_study_names_the_shipped_ones() -> None:
    with pytest.raises(ScenarioError, match=r"no such file.*did you mean mass_friction.*shipped: "):
        studies.load("mass_frictoin")


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (
            '[[factor]]\nkey = "coordnation.p"\nuniform = [1.0, 2.0]\n',
            'study.toml: factor.0.key = "coordnation.p": unknown key; did you mean coordination?',
        ),
        (
            '[[factor]]\nkey = "control.k9"\nuniform = [1.0, 2.0]\n',
            'factor.0.key = "control.k9": unknown key',
        ),
        (
            '[[factor]]\nkey = "robot.r9.v_m_s"\nuniform = [0.1, 0.2]\n',
            "no 'r9' there; known: r1, r2",
        ),
    ],
)
def test_an_unknown_key_of_a_factor_is_refused_at_once(factor: str, said: str) -> None:
    with pytest.raises(ScenarioError) as found:
        cases_of(RANDOM + factor + FEW)
    assert said in str(found.value)


@pytest.mark.parametrize(
    ("quantity", "said"),
    [
        ("peak_x_em", "no such signal; did you mean x_e_m?"),
        ("x_e_m", "must begin with a statistic (peak_, final_, rms_"),
    ],
)
def test_an_unknown_quantity_is_refused(quantity: str, said: str) -> None:
    with pytest.raises(ScenarioError) as found:
        cases_of(RANDOM + MASS + f'[keep]\nquantities = ["{quantity}"]\n')
    assert said in str(found.value)


THEORY = RANDOM + P + "[theory]\n[keep]\nquantities = []\n"


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("coordination.v_hat_0=0.5", "must be leader.speed_m_s = 0.6"),
        ("robot.r2.s_0=0.0", "there is no disagreement that could grow"),
        ("robot.r2.leaves_at_s=0.05", "robots that are always there"),
        ('network.default.delay={ kind = "constant", delay_s = 0.1 }', "values that come at once"),
        ("graph.switch=[{ at_s = 0.04, generator = 'ring' }]", "doesn't switch"),
    ],
)
def test_a_base_that_theory_is_not_of_is_refused(override: str, said: str) -> None:
    head = THEORY.replace('"until_s=0.1"', '"until_s=0.1", "robot.r2.s_0=0.1"')
    cases_of(head)
    with pytest.raises(ScenarioError) as found:
        cases_of(head.replace('"robot.r2.s_0=0.1"', f'"robot.r2.s_0=0.1", {override!r}'))
    assert said in str(found.value)


def test_the_columns_of_theory_are_no_others() -> None:
    factor = '[[factor]]\nname = "growth_46_1_s"\nkey = "control.k1"\nvalues = [1.0, 2.0]\n'
    loads("s.toml", RANDOM + factor)
    with pytest.raises(ScenarioError, match="is a column of every dataset"):
        loads("s.toml", RANDOM + factor + "[theory]\n")


def test_a_base_that_needs_the_wall_clock_or_processes_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"clock\.mode"):
        cases_of(RANDOM.replace("until_s=0.1", "clock.mode=realtime") + MASS)


def test_the_schema_for_editors_knows_every_kind_of_factor() -> None:
    properties = json_schema()["$defs"]["FactorSection"]["properties"]
    assert {"values", "range", "integers", "graph", "uniform", "log_uniform", "normal"} <= {
        *properties
    }
