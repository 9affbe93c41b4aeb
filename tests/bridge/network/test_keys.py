"""Keys: one place for all of them, and names that can't break out."""

import pytest
import zenoh

from bridge.network import keys
from configs.errors import ScenarioError


def test_keys_read_as_documented() -> None:
    assert keys.path("run", "r1") == "fleetloop/run/robot/r1/path"
    assert keys.pose("run", "r1") == "fleetloop/run/robot/r1/pose"
    assert keys.leader_speed("run") == "fleetloop/run/leader/speed"
    assert keys.live("run", "agent/r1") == "fleetloop/run/@live/agent/r1"


@pytest.mark.parametrize("name", ["", "*", "**", "a/b", "$*", "#", "?", "@x", "-x", "r 1", "ä"])
def test_a_name_that_is_no_key_chunk_is_refused(name: str) -> None:
    with pytest.raises(ScenarioError, match="Zenoh key"):
        keys.path("run", name)


def test_the_process_of_a_control_key_is_found_again() -> None:
    for process in ("plant", "recorder", "agent/r12"):
        assert keys.process_of(keys.report("run-1", process)) == process


def test_no_wildcard_of_data_meets_the_control_plane() -> None:
    everything = zenoh.KeyExpr("fleetloop/run/**")
    assert everything.intersects(zenoh.KeyExpr(keys.path("run", "r1")))
    for key in (keys.go("run"), keys.live("run", "plant"), keys.report("run", "plant")):
        assert not everything.intersects(zenoh.KeyExpr(key))
