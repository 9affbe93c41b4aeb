"""The table of roles, against the modules and briefs that it names."""

import importlib.util

from configs.roles import AGENT, ROLES, STARTED, identity_of, processes_of
from fleetloop.launch.spawn import BRIEFS


def test_every_role_that_a_run_starts_has_a_module_a_brief_and_what_fills_it() -> None:
    for role in STARTED:
        assert importlib.util.find_spec(role.module) is not None, role
        assert role.brief is not None, role
    assert BRIEFS.keys() == {role.name for role in STARTED}


def test_a_role_watches_roles_that_there_are() -> None:
    names = [role.name for role in ROLES]
    assert len(set(names)) == len(names)
    assert all(other in names for role in ROLES for other in role.watches)


def test_a_process_is_named_by_role_and_robot_and_run_in_the_order_of_the_table() -> None:
    assert AGENT.process("r1") == "agent/r1"
    assert AGENT.identity("r1") == identity_of("agent/r1") == "agent-r1"
    assert processes_of(("r1", "r2")) == ("plant", "agent/r1", "agent/r2", "recorder")
