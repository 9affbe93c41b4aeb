"""Maps: exact values of grids, means of samples, cells without a case."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fleetloop.sweep.report.columns import Column
from fleetloop.sweep.report.heat import axis_of, heat_of

X, Y = (part.ravel() for part in np.meshgrid([0.1, 0.2, 0.4], [1.0, 10.0, 100.0, 1000.0]))


def test_a_cell_of_a_grid_is_one_point_and_has_its_exact_value() -> None:
    x, y = Column("x", X, exact=True), Column("y", Y, exact=True, log=True)
    heat = heat_of(x, y, Column("z", X * Y))
    assert (heat.means == np.outer([1.0, 10.0, 100.0, 1000.0], [0.1, 0.2, 0.4])).all()
    assert (heat.counts == 1).all()
    assert heat.empty == 0


def test_edges_of_levels_lie_halfway_in_the_logarithm_too() -> None:
    assert axis_of(Column("x", X, exact=True), 12).edges == pytest.approx([0.05, 0.15, 0.3, 0.5])
    of_log = axis_of(Column("y", Y, exact=True, log=True), 12).edges
    assert of_log == pytest.approx(10.0 ** np.arange(-0.5, 4.0))


def test_a_grid_that_is_not_done_has_cells_without_a_value() -> None:
    done = np.arange(12) < 7
    z = np.where(np.arange(12) == 0, np.nan, X)  # one that brought nothing
    heat = heat_of(
        Column("x", X, exact=True).take(done),
        Column("y", Y, exact=True).take(done),
        Column("z", z[done]),
    )
    assert heat.means.shape == (3, 3)
    assert heat.empty == 3
    assert np.isnan(heat.means[0, 0])
    assert np.isnan(heat.means[2, 1:]).all()


@given(
    arrays(np.float64, (200, 2), elements=st.floats(0.001, 1e3)),
    st.booleans(),
)
def test_every_case_of_a_sample_is_in_one_cell(points: np.ndarray, log: bool) -> None:
    x, y = (Column(name, points[:, n], log=log) for n, name in enumerate("xy"))
    if not (x.varies and y.varies):
        return
    heat = heat_of(x, y, Column("z", np.ones(200)))
    assert heat.counts.sum() == 200
    assert set(heat.means[heat.counts > 0].tolist()) == {1.0}


def test_the_mean_of_a_sampled_plane_is_the_plane_in_the_middle_of_each_cell() -> None:
    side = (np.arange(400) + 0.5) / 400
    x, y = (part.ravel() for part in np.meshgrid(side, side))
    heat = heat_of(Column("x", x), Column("y", y), Column("z", 2.0 * x - y))
    middles = 0.5 * (heat.x.edges[1:] + heat.x.edges[:-1])
    expected = 2.0 * middles[None, :] - middles[:, None]
    assert heat.means == pytest.approx(expected, abs=5e-3)


def test_more_cases_give_finer_cells() -> None:
    x = np.linspace(0.0, 1.0, 5000)
    assert [axis_of(Column("x", x), n).cells for n in (10, 1000, 5000)] == [4, 11, 24]


def test_levels_of_texts_are_places() -> None:
    laws = Column("law", np.array([0.0, 1.0, np.nan]), levels=("paper", "robust"))
    axis = axis_of(laws, 3)
    assert axis.edges.tolist() == [-0.5, 0.5, 1.5]
    assert axis.places().tolist() == [0, 1, -1]
