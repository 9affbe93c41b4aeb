"""Without the extra a sweep says in one line what to install."""

import pytest

from configs.errors import ExitStatus, ScenarioError
from fleetloop.sweep.extra import PACKAGES, require


def test_what_is_missing_is_named_with_the_extra_that_has_it() -> None:
    with pytest.raises(ScenarioError) as found:
        require("pyarrow", "not_there", "nor_there")
    assert str(found.value) == (
        "fleetloop sweep needs not_there and nor_there: pip install 'fleetloop[sweep]'"
    )
    assert found.value.exit_status == ExitStatus.USAGE
    with pytest.raises(ScenarioError, match=r"^fleetloop tune needs not_there: pip install "):
        require("pyarrow", "not_there", verb="tune")


def test_what_is_there_is_enough() -> None:
    require(*PACKAGES)
