"""How far the leader goes, in closed form."""

import pytest

from configs.leader_speed import SpeedChange
from fleetloop.launch.drawn import ways_m

S = 1_000_000_000


@pytest.mark.parametrize(
    ("changes", "until_s", "ways"),
    [
        ([(0, 0.6, 0)], 10.0, (0.0, 6.0)),
        ([(0, -0.6, 0)], 10.0, (-6.0, 0.0)),
        # 1 m/s for 5 s; a ramp to -1 m/s within 2 s, which turns after 1 s; back for 3 s
        ([(0, 1.0, 0), (5 * S, -1.0, 2 * S)], 10.0, (0.0, 5.5)),
        ([(0, 1.0, 0), (5 * S, -1.0, 2 * S)], 20.0, (-8.0, 5.5)),
        ([(0, 1.0, 0), (2 * S, -2.0, 0)], 4.0, (-2.0, 2.0)),
        ([(0, 1.0, 0), (5 * S, -1.0, 2 * S)], 3.0, (0.0, 3.0)),
    ],
)
def test_a_leader_that_turns_goes_farther_than_where_it_ends(
    changes: list[tuple[int, float, int]], until_s: float, ways: tuple[float, float]
) -> None:
    found = ways_m([SpeedChange(*one) for one in changes], until_s)
    assert found == pytest.approx(ways, abs=1e-6)
