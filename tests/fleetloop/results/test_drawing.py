"""Parts of figures."""

import pytest

from fleetloop.results.drawing import axes_of, legend


@pytest.mark.filterwarnings("error")
def test_a_panel_without_lines_has_no_legend_and_draws_no_complaint() -> None:
    _, axes = axes_of()
    legend(axes, 0)
    assert axes.get_legend() is None
    axes.plot([0.0, 1.0], label="r1")
    legend(axes, 1)
    assert axes.get_legend() is not None
