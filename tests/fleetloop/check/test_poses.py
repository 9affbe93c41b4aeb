"""Ages of poses on emulated edges, against the run."""

import pytest

from configs.loading import load
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding
from fleetloop.check.rehearsal import rehearsal

SHORT = "duration_s=6.0", "expect=[]"


def lossy(probability: float) -> str:
    loss = f"{{kind='bernoulli', probability={probability}}}"
    return f"network.edge=[{{edges=['localisation -> r1'], loss={loss}}}]"


def found(*overrides: str) -> list[Finding]:
    findings = examine("two_robots_100hz", load("two_robots_100hz", (*SHORT, *overrides)))
    return [finding for finding in findings if finding.title == "age of poses"]


def test_poses_that_arrive_have_no_line() -> None:
    assert not found()


@pytest.mark.parametrize(("probability", "level"), [(0.5, "ok"), (0.97, "error")])
def test_a_robot_stops_where_poses_get_older_than_its_limit(probability: float, level: str) -> None:
    (finding,) = found(lossy(probability))
    assert (finding.level, finding.robots) == (level, ("r1",))
    stopped = rehearsal(load("two_robots_100hz", (*SHORT, lossy(probability))), 6.0).stopped
    assert ("r1" in stopped) == (level == "error")
