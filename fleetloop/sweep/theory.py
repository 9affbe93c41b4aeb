"""Theory against simulation, case by case: whether the path variables' disagreement grows.

    growth_1_s          of μ of all robots together, as simulated (`fleetloop.sweep.growth`)
    growth_sampled_1_s  ln ρ(s, μ)/T of the exact map from share to share, T apart
    growth_46_1_s       max Re λ of λ² + p λ + q ζ over the eigenvalues ζ ≠ 0 of L: < 0 iff (46)

All in 1/s; above 0 the disagreement grows. A case contradicts a condition if its growth as
simulated has another sign. (46) is of the law in continuous time: values that are shared now and
then, and held in between, move the boundary by a share of p T.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from configs.errors import Complaint
from configs.netem import Effects
from configs.scenario import Scenario
from fleetloop.check.coordination import sampled_growth_1_s
from fleetloop.check.graph import continuous_growth_1_s
from fleetloop.sweep.study import CONTINUOUS, MEASURED, SAMPLED, Condition

COLUMN_OF: Mapping[Condition, str] = {"sampled": SAMPLED, "(46)": CONTINUOUS}
LABELS = {
    MEASURED: "growth of the disagreement",
    SAMPLED: "growth by the map from share to share",
    CONTINUOUS: "growth in continuous time, (46)",
}
NEAR_1_S = 0.01
"""Growth next to a boundary: there simulation and theory are compared number by number."""


def unfit(base: Scenario, name: str) -> Iterator[Complaint]:
    """What keeps a base from being compared with theory."""
    gains, speed = base.coordination, base.leader.speed_m_s
    if base.topology.switches:
        yield Complaint(name, "theory", "graph.switch", "theory is of a graph that doesn't switch")
    if base.network.default != Effects() or base.network.edge:
        yield Complaint(name, "theory", "network", "theory is of values that come at once")
    if any(robot.joins_at_s or robot.leaves_at_s is not None for robot in base.robot):
        yield Complaint(name, "theory", "robot", "theory is of robots that are always there")
    if base.leader.steps or gains.v_hat_0 != speed:
        remedy = f"must be leader.speed_m_s = {speed:g}, without steps: else speed estimates move"
        yield Complaint(name, "theory: coordination.v_hat_0", gains.v_hat_0, remedy)
    if len({robot.s_0 for robot in base.robot}) == 1 and not gains.mu_0:
        remedy = "are all equal: there is no disagreement that could grow"
        yield Complaint(name, "theory: robot.*.s_0", base.robot[0].s_0, remedy)


def predicted(scenario: Scenario) -> dict[str, float | None]:
    """Growth by theory, by column [1/s]; None where theory is of other scenarios."""
    if any(unfit(scenario, scenario.name)):
        return dict.fromkeys(COLUMN_OF.values())
    graph, gains = scenario.topology, scenario.coordination
    p, q = gains.p, gains.q
    period_s = scenario.clock.share_period_s
    return {
        SAMPLED: sampled_growth_1_s(graph, p, q, period_s, gains.age_limit_s),
        CONTINUOUS: continuous_growth_1_s(graph, p, q),
    }


def margin_1_s(condition: Condition, values: Mapping[str, float | None]) -> float | None:
    """Growth as simulated, positive where theory has the same sign; None: there is none."""
    measured, theory = values.get(MEASURED), values.get(COLUMN_OF[condition])
    if measured is None or theory is None:
        return None
    return measured if grows(theory) else -measured


def agrees(condition: Condition, values: Mapping[str, float | None]) -> bool | None:
    """Whether simulation and theory say the same; None: one of them says nothing."""
    measured, theory = values.get(MEASURED), values.get(COLUMN_OF[condition])
    if measured is None or theory is None:
        return None
    return bool(grows(measured) == grows(theory))


def grows(growth_1_s: Any) -> Any:
    """Whether a disagreement of this growth, or each of these, doesn't vanish."""
    return growth_1_s >= 0.0


def contradiction(condition: Condition, values: Mapping[str, float | None]) -> str:
    """Why a case fails: both numbers."""
    return (
        f"{LABELS[MEASURED]} {values[MEASURED]:.3g} 1/s, by theory ({condition})"
        f" {values[COLUMN_OF[condition]]:.3g} 1/s"
    )


class Agreement(NamedTuple):
    """How often simulation and one condition say the same."""

    condition: Condition
    judges: bool
    """Whether the verdicts are by it."""
    agree: int
    disagree: int
    stable: int
    """Of all compared, as simulated."""
    unstable: int
    farthest_1_s: float
    """The largest growth, as simulated, that has another sign than by theory; 0: none has."""
    least_1_s: float
    """The least growth, in magnitude, as simulated."""
    off_1_s: float
    """The largest difference of the two growths within `NEAR_1_S` of the boundary."""

    @property
    def words(self) -> str:
        """For a line."""
        what = "the law as sampled" if self.condition == "sampled" else "(46), in continuous time"
        text = f"{what}: {self.agree} of {self.agree + self.disagree} cases agree"
        text += f", {self.disagree} disagree{'s' if self.disagree == 1 else ''}"
        if self.disagree:
            text += f", of at most {self.farthest_1_s:.2g} 1/s"
        return text


def agreements(judging: Condition, columns: Mapping[str, NDArray[np.float64]]) -> list[Agreement]:
    """Of both conditions, the one that judges first; `columns` by name, NaN where there is none."""
    measured = columns[MEASURED]
    found = []
    for condition in sorted(COLUMN_OF, key=lambda one: one != judging):
        theory = columns[COLUMN_OF[condition]]
        known = np.isfinite(measured) & np.isfinite(theory)
        ours, says = measured[known], theory[known]
        differs = grows(ours) != grows(says)
        near = np.abs(says) < NEAR_1_S
        found.append(
            Agreement(
                condition,
                condition == judging,
                int((~differs).sum()),
                int(differs.sum()),
                int((~grows(ours)).sum()),
                int(grows(ours).sum()),
                float(np.abs(ours[differs]).max(initial=0.0)),
                float(np.abs(ours).min(initial=np.inf)),
                float(np.abs(ours - says)[near].max(initial=0.0)),
            )
        )
    return found


def of_table(table: Any) -> dict[str, NDArray[np.float64]]:
    """The columns of growth of a dataset's table."""
    return {
        name: np.array(table.column(name).to_numpy(), dtype=np.float64)
        for name in (MEASURED, SAMPLED, CONTINUOUS)
    }
