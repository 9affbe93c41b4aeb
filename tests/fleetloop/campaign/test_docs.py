"""The matrices in docs/campaigns.md."""

import re
from pathlib import Path

from configs.faults.kinds import KINDS
from fleetloop.campaign.tables import LETTERS

PAGE = Path(__file__).parents[3] / "docs" / "campaigns.md"
ROW = re.compile(r"^\| (`[a-z_]+`(?:, `[a-z_]+`)*) \|((?: [^|]+\|)+)$", re.MULTILINE)
CELL = re.compile(rf"\*?\*?[{''.join(LETTERS.values())}]\*?\*?( [\d.]+)?")


def test_rows_are_of_kinds_that_there_are_and_cells_of_letters_that_are_explained() -> None:
    text = PAGE.read_text("utf-8").partition("## What the paper's formation survives")[2]
    rows = ROW.findall(text)
    assert len(rows) > 30
    for kinds, cells in rows:
        assert {*re.findall(r"[a-z_]+", kinds)} <= {*KINDS}
        assert all(CELL.fullmatch(cell.strip()) for cell in cells.split("|")[:-1]), cells
