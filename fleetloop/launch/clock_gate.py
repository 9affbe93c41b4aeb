"""The clocks of a run's machines before its start: known, and close enough together."""

from collections.abc import Callable

from configs.deployment import Deployment
from configs.errors import InfrastructureError
from configs.resolve import leader_brief
from configs.scenario import Scenario
from fleetloop.launch import placement
from fleetloop.launch.clock_offsets import WAITED_S, ClockOffsets, too_far_apart


class ClockGate:
    """Lets a run begin once the clocks of other machines are known.

    Args:
        scenario: of the run.
        deployment: of the run.
        clocks: what is known of them.
        now_s: seconds on the launcher's clock of awake time.
    """

    def __init__(
        self,
        scenario: Scenario,
        deployment: Deployment,
        clocks: ClockOffsets,
        now_s: Callable[[], float],
    ) -> None:
        self._scenario = scenario
        self._deployment = deployment
        self._clocks = clocks
        self._now_s = now_s
        self._since_s: float | None = None

    def known(self) -> bool:
        """Whether they are known, or were waited for long enough."""
        if self._since_s is None:
            self._since_s = self._now_s()
        return self._clocks.enough() or self._now_s() > self._since_s + WAITED_S

    def refuse(self) -> None:
        """Refuse a run whose machines' clocks are too far apart.

        Raises:
            InfrastructureError: they are; the text names them.
        """
        network, clocks = self._deployment.network, self._clocks
        clocks.at_start = clocks.offsets()
        if network is None or self._scenario.clock.mode != "realtime":
            return
        changes = leader_brief(self._scenario).speed_changes
        speed_m_s = max(abs(change.speed_m_s) for change in changes)
        hops = placement.hops(self._scenario, self._deployment)
        far = too_far_apart(clocks.at_start, hops, speed_m_s, network.clock_tolerance_m)
        if far:
            raise InfrastructureError(
                f"{'; '.join(far)}: more than network.clock_tolerance_m ="
                f" {network.clock_tolerance_m:g}; keep the machines' clocks together (chrony, PTP)"
            )
