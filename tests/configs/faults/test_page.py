"""The page on faults has a row of every kind, with what its class says."""

from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from configs.faults.base import Fault, RobotFault, WheelFault
from configs.faults.kinds import CLASSES, KINDS

PAGE = Path(__file__).resolve().parents[3] / "docs" / "faults.md"
NEEDS = {"powertrain": '`drive.preset = "realistic"`', "wire": '`bus.timing = "wire"`'}
COLUMNS = 7
COMMON = {"kind", "name", "at_s", "for_s", "robots", "wheel", "edges"}


def shown(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def parameters(cls: type[Fault]) -> str:
    said = []
    for one in fields(cls):
        if one.name in COMMON:
            continue
        value = "" if one.default in (None, MISSING) else f" = {shown(one.default)}"
        about = one.metadata.get("description", "")
        said.append(f"`{one.name}{value}`" + (f" {about}" if about else ""))
    return "; ".join(said)


def row(cls: type[Fault]) -> list[str]:
    kinds = ", ".join(f"`{kind}`" for kind, of in KINDS.items() if of is cls)
    wheel = "wheels" if issubclass(cls, WheelFault) else "robots"
    target = wheel if issubclass(cls, RobotFault) else "edges"
    doc = (cls.__doc__ or "").strip().removesuffix(".")
    when = "an instant" if cls.INSTANT else "lasts"
    needs = ", ".join(NEEDS[model] for model in sorted(cls.NEEDS))
    return [kinds, f"{cls.PLACE}: {target}", when, parameters(cls), doc, needs]


def rows() -> dict[str, list[str]]:
    lines = PAGE.read_text("utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "|" in line]
    return {row[0]: row for row in cells if len(row) == COLUMNS and row[0].startswith("`")}


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_a_kind_stands_on_the_page_as_its_class_has_it(cls: type[Fault]) -> None:
    wanted = row(cls)
    found = rows().get(wanted[0])
    line = "| " + " | ".join(wanted) + " | what the controller does |"
    assert found is not None, f"missing: {line}"
    assert found[:-1] == wanted, f"should be: {line}"
    assert found[-1]


def test_the_page_names_no_other_kinds() -> None:
    named = {kind.strip("` ") for cells in rows() for kind in cells.split(",")}
    assert named == set(KINDS)
