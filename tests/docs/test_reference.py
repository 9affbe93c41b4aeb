"""docs/reference is what the types in the code say."""

from collections.abc import Iterator

import pytest

from configs.loading import json_schema
from docs.generate.markdown import unit_of
from docs.generate.pages import FOLDER, pages

PAGES = pages()


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_made_of_the_types_of_today(name: str) -> None:
    committed = (FOLDER / name).read_text("utf-8") if (FOLDER / name).is_file() else ""
    assert committed == PAGES[name], "run: uv run --group dev python -m docs.generate"


def test_no_page_of_the_folder_is_left_over() -> None:
    assert {page.name for page in FOLDER.iterdir()} == set(PAGES)


def test_every_key_of_a_scenario_stands_on_a_page() -> None:
    keys, said = set(_keys(json_schema())), "".join(PAGES.values())
    assert len(keys) > 150
    assert [key for key in keys if f"| `{key}` |" not in said and f"[{key}" not in said] == []


def _keys(schema: object) -> Iterator[str]:
    """The keys of all tables of a schema, but for those that choose a table."""
    if isinstance(schema, dict):
        own = schema.get("properties", {})
        yield from (key for key in own if key not in ("kind", "law", "protocol"))
        yield from (key for part in schema.values() for key in _keys(part))
    elif isinstance(schema, list):
        yield from (key for part in schema for key in _keys(part))


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("control_period_s", "s"),
        ("speed_m_s", "m/s"),
        ("torque_limit_wheel_N_m", "N·m"),
        ("torque_slew_limit_wheel_N_m_s", "N·m/s"),
        ("damping_right_wheel_N_m_s", "N·m·s"),
        ("gamma_1_s", "s"),
        ("k_x_1_s", "1/s"),
        ("seed", ""),
    ],
)
def test_the_unit_of_a_key_is_in_its_name(key: str, unit: str) -> None:
    assert unit_of(key) == unit
