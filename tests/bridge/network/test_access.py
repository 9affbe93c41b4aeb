"""Access control: generated from the graph, default deny, over real sessions."""

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

from bridge.network import access, keys
from bridge.network.client import open_client, open_polled
from bridge.network.router import RouterLink, open_router
from bridge.network.zenoh_link import PolledLink, ZenohLink
from configs.connections import NetworkLink
from configs.errors import InfrastructureError
from configs.loading import load
from configs.roles import AGENT, LAUNCHER, LOCALISATION, PLANT, VIEWER, processes_of

ROBOTS = ("r1", "r2", "r3", "r4")
HEARS = {"r1": (), "r2": ("r1",), "r3": ("r2",), "r4": ("r2", "r3")}
RUN = "test"


@pytest.fixture
def plan() -> access.AccessPlan:
    return access.plan(RUN, ROBOTS, HEARS, ("r1",))


@pytest.fixture
def router(plan: access.AccessPlan, tmp_path: Path) -> Iterator[RouterLink]:
    with open_router(None, plan, tmp_path) as link:
        yield link


def client(router: RouterLink, plan: access.AccessPlan, user: str) -> ZenohLink:
    return open_client(NetworkLink(RUN, router.endpoint, user, plan.passwords[user]), 5.0)


def polled(router: RouterLink, plan: access.AccessPlan, user: str) -> PolledLink:
    login = NetworkLink(RUN, router.endpoint, user, plan.passwords[user])
    return open_polled(login, 5.0, depth=64)


def test_rights_of_a_robot_are_its_graph(plan: access.AccessPlan) -> None:
    rights = plan.rights["agent-r4"]
    assert keys.path(RUN, "r4") in rights.puts
    assert set(rights.hears) == {
        keys.pose(RUN, "r4"),
        keys.go(RUN),
        keys.ping(RUN),
        keys.report(RUN, LAUNCHER.name),
        keys.path(RUN, "r2"),
        keys.path(RUN, "r3"),
        keys.order(RUN, "agent/r4"),
        keys.silence(RUN, "r2"),
        keys.silence(RUN, "r3"),
    }
    assert keys.leader_speed(RUN) in plan.rights["agent-r1"].hears
    assert keys.leader_speed(RUN) not in plan.rights["agent-r2"].hears


@pytest.mark.parametrize("share_period_s", [None, 0.02])
def test_faults_are_ordered_by_the_launcher_and_in_lockstep_handed_on_by_the_plant(
    share_period_s: float | None,
) -> None:
    plan = access.plan(RUN, ROBOTS, HEARS, (), external=True, share_period_s=share_period_s)
    to_controllers = {keys.order(RUN, AGENT.process(robot)) for robot in ROBOTS}
    orders = {*to_controllers, keys.order(RUN, PLANT.name)}
    may = {user: orders.intersection(rights.puts) for user, rights in plan.rights.items()}
    assert may.pop(LAUNCHER.identity()) == orders
    assert may.pop(PLANT.identity()) == (to_controllers if share_period_s is None else set())
    assert not any(may.values())


def test_everything_that_is_not_allowed_is_denied(plan: access.AccessPlan) -> None:
    rules = plan.access_control()
    assert rules["default_permission"] == "deny"
    assert {rule["permission"] for rule in rules["rules"]} == {"allow"}
    assert all("*" not in key for rule in rules["rules"] for key in rule["key_exprs"])


def test_passwords_are_long_random_and_not_shown(plan: access.AccessPlan) -> None:
    assert len(set(plan.passwords.values())) == len(plan.passwords)
    assert min(map(len, plan.passwords.values())) >= 32
    assert not any(word in repr(plan) for word in plan.passwords.values())


def test_the_user_dictionary_does_not_stay_on_disk(router: RouterLink, tmp_path: Path) -> None:
    assert list(tmp_path.iterdir()) == []


def heard_by(link: ZenohLink, seconds: float) -> set[tuple[str, bytes]]:
    """All (tag, payload) that arrive until nothing new came for a while."""
    found = set()
    while (arrival := link.receive(seconds)) is not None:
        found.add((arrival.tag, arrival.payload))
    return found


def assert_heard(
    router: RouterLink,
    plan: access.AccessPlan,
    hears: Mapping[str, Sequence[str]],
    leader: Sequence[str],
) -> None:
    """Every pair of robots, and the leader to each: what is granted carries, nothing else does."""
    links = {robot: client(router, plan, AGENT.identity(robot)) for robot in ROBOTS}
    try:
        for link in links.values():
            for other in ROBOTS:
                link.subscribe(keys.path(RUN, other), other)
            link.subscribe(keys.leader_speed(RUN), "leader")
        mouths = {robot: link.publisher(keys.path(RUN, robot)) for robot, link in links.items()}
        voice = router.publisher(keys.leader_speed(RUN))
        expected = {
            robot: {(other, b"from " + other.encode()) for other in hears[robot]}
            | ({("leader", b"v_r")} if robot in leader else set())
            for robot in ROBOTS
        }
        found: dict[str, set[tuple[str, bytes]]] = {robot: set() for robot in ROBOTS}
        deadline = time.monotonic() + 20.0
        # Again and again until every allowed edge has carried something; each round gives a
        # forbidden one the same chance.
        while found != expected and time.monotonic() < deadline:
            for robot, mouth in mouths.items():
                mouth.put(b"from " + robot.encode())
            voice.put(b"v_r")
            for robot, link in links.items():
                found[robot] |= heard_by(link, 0.05)
            assert all(found[robot] <= expected[robot] for robot in ROBOTS)
        assert found == expected
    finally:
        for link in links.values():
            link.close()


@pytest.mark.system
def test_a_robot_hears_exactly_its_in_neighbours_on_every_pair(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    assert_heard(router, plan, HEARS, ("r1",))


@pytest.mark.system
def test_a_subscription_that_ends_is_undeclared_and_may_be_declared_again(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    key = keys.path(RUN, "r1")
    with client(router, plan, "agent-r1") as speaker, polled(router, plan, "agent-r2") as hearer:
        mouth = speaker.publisher(key)

        def is_heard(wanted: bool) -> bool:
            """Whether the router comes to say that there is a subscriber, or none."""
            deadline = time.monotonic() + 10.0
            while mouth.matching_status.matching is not wanted and time.monotonic() < deadline:
                hearer.receive(0.01)
            return bool(mouth.matching_status.matching)

        for word in (b"first", b"again"):
            hearer.subscribe(key, "path/r1")
            assert is_heard(True)
            mouth.put(word)
            mouth.put(word)
            arrival = hearer.receive(10.0)
            assert arrival is not None
            assert (arrival.tag, arrival.payload) == ("path/r1", word)
            hearer.unsubscribe(key)
            assert not is_heard(False)
            assert hearer.receive(0.0) is None  # what waited is dropped


@pytest.mark.system
def test_a_switching_graph_is_granted_the_union_of_its_edges_and_nothing_beyond(
    tmp_path: Path,
) -> None:
    switch = "{at_s=1.0, rotate=[['r1 -> r2'], ['r3 -> r2', 'leader -> r3']], dwell_s=0.5}"
    changes = f"graph={{edges=['r1 -> r2', 'r2 -> r3', 'r3 -> r4'], switch=[{switch}]}}"
    graph = load("paper", [changes, "expect=[]"]).topology
    assert graph.in_neighbours == {"r1": (), "r2": ("r1", "r3"), "r3": ("r2",), "r4": ("r3",)}
    assert graph.leader == ("r1", "r3")
    plan = access.plan(RUN, ROBOTS, graph.in_neighbours, graph.leader)
    with open_router(None, plan, tmp_path) as router:
        assert_heard(router, plan, graph.in_neighbours, graph.leader)


@pytest.mark.system
def test_nobody_can_speak_under_another_robots_key(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    for robot in ROBOTS:
        router.subscribe(keys.path(RUN, robot), f"path of {robot}")
    router.subscribe(keys.leader_speed(RUN), "leader")
    router.subscribe(keys.go(RUN), "go")
    for impostor in ROBOTS:
        router.subscribe(keys.report(RUN, f"agent/{impostor}"), f"report of {impostor}")
        with client(router, plan, AGENT.identity(impostor)) as link:
            forged = [keys.path(RUN, r) for r in ROBOTS if r != impostor]
            forged += [keys.pose(RUN, impostor), keys.leader_speed(RUN), keys.go(RUN)]
            for key in forged:
                link.publisher(key).put(b"forged")
            own = link.publisher(keys.report(RUN, f"agent/{impostor}"))
            honest = set()
            deadline = time.monotonic() + 10.0
            # One session keeps order: once its own key arrives, the forged ones would have.
            while not honest and time.monotonic() < deadline:
                own.put(b"honest")
                honest = heard_by(router, 0.05)
            assert honest == {(f"report of {impostor}", b"honest")}


@pytest.mark.system
def test_a_viewer_hears_rows_progress_and_notices_and_can_put_nothing(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    processes = processes_of(ROBOTS)
    hears = {of(RUN, robot) for of in (keys.truth, keys.telemetry) for robot in ROBOTS}
    hears |= {of(RUN, process) for of in (keys.progress, keys.notice) for process in processes}
    rights = plan.rights[VIEWER.identity()]
    assert set(rights.hears) == hears
    assert (rights.puts, rights.tokens) == ((), (keys.live(RUN, VIEWER.name),))
    forged = [of(RUN, robot) for of in (keys.path, keys.pose, keys.truth) for robot in ROBOTS]
    forged += [of(RUN, process) for of in (keys.order, keys.report) for process in processes]
    forged += [keys.leader_speed(RUN), keys.go(RUN)]
    heard: list[str] = []
    for key in forged:
        router.each(key, lambda payload: heard.append(payload.decode()))
    there = threading.Event()
    router.each_live(keys.live(RUN, VIEWER.name), lambda *_: there.set())
    with (
        client(router, plan, VIEWER.identity()) as viewer,
        client(router, plan, PLANT.identity()) as plant,
        client(router, plan, AGENT.identity("r3")) as r3,
    ):
        for key in hears:
            viewer.subscribe(key, key)
        for key in forged:
            viewer.publisher(key).put(b"forged")
            viewer.publisher(key, steady=True).put(b"forged")
        mouths = [(plant, keys.truth(RUN, "r1")), (plant, keys.progress(RUN, "plant"))]
        mouths += [(r3, keys.telemetry(RUN, "r3")), (r3, keys.notice(RUN, "agent/r3"))]
        said = {key: link.publisher(key) for link, key in mouths}
        found: set[tuple[str, bytes]] = set()
        deadline = time.monotonic() + 10.0
        while len(found) < len(said) and time.monotonic() < deadline:
            for publisher in said.values():
                publisher.put(b"honest")
            found |= heard_by(viewer, 0.05)
        assert found == {(key, b"honest") for key in said}
        viewer.declare_live(keys.live(RUN, VIEWER.name))
        assert there.wait(10.0)
    assert set(heard) == {"honest"}  # the plant's row, but nothing that was forged


@pytest.mark.system
def test_a_wrong_password_and_an_unknown_user_are_refused(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    for user, word in (("agent-r1", "wrong"), ("stranger", plan.passwords["agent-r1"])):
        with pytest.raises(InfrastructureError, match=f"{user}: no session with the router"):
            open_client(NetworkLink(RUN, router.endpoint, user, word), 1.0)


@pytest.mark.system
def test_a_port_in_use_is_named(
    router: RouterLink, plan: access.AccessPlan, tmp_path: Path
) -> None:
    (tmp_path / "second").mkdir()
    with (
        pytest.raises(InfrastructureError, match="already in use") as caught,
        open_router(router.endpoint, plan, tmp_path / "second"),
    ):
        pass
    assert router.endpoint in str(caught.value)


@pytest.mark.system
def test_a_liveliness_token_comes_and_goes_with_its_session(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    for process in ("plant", "recorder"):
        router.watch_live(keys.live(RUN, process), "live")
    with client(router, plan, PLANT.name) as link:
        link.declare_live(keys.live(RUN, "plant"))
        link.declare_live(keys.live(RUN, "recorder"))  # not its own
        arrival = router.receive(5.0)
        assert arrival is not None
        assert (keys.process_of(arrival.key), arrival.payload) == ("plant", b"1")
    arrival = router.receive(5.0)
    assert arrival is not None
    assert (keys.process_of(arrival.key), arrival.payload) == ("plant", b"0")
    assert router.receive(0.1) is None


def test_guests_keep_their_passwords_and_show_certificates_if_they_must() -> None:
    plan = access.plan(
        RUN, ROBOTS, HEARS, ("r1",), guests={"agent-r2": "agent-r2#2"}, certified=True
    )
    assert plan.passwords["agent-r2"] == "agent-r2#2"
    assert len(plan.passwords["agent-r1"]) >= 32
    subjects = {s["id"]: s for s in plan.access_control()["subjects"]}
    assert subjects["agent-r2"]["cert_common_names"] == ["agent-r2#2"]
    assert "cert_common_names" not in subjects["agent-r1"]


def test_the_pose_of_a_robot_that_is_not_emulated_is_the_localisation_systems_alone() -> None:
    plan = access.plan(RUN, ROBOTS, HEARS, ("r1",), real_robots=["r3"])
    pose = keys.pose(RUN, "r3")
    speakers = [user for user, rights in plan.rights.items() if pose in rights.puts]
    assert speakers == [LOCALISATION.name]
    assert pose in plan.rights[PLANT.name].hears
    assert keys.pose(RUN, "r1") in plan.rights[PLANT.name].puts
    assert LOCALISATION.name not in access.plan(RUN, ROBOTS, HEARS, ("r1",)).rights


def test_a_token_that_is_withdrawn_or_whose_session_ends_is_noticed(
    router: RouterLink, plan: access.AccessPlan
) -> None:
    token = keys.live(RUN, LAUNCHER.name)
    gone = threading.Event()
    with client(router, plan, "agent-r1") as watcher:
        router.declare_live(token)
        watcher.on_gone(token, gone.set)
        assert not gone.wait(0.1)
        router.withdraw_live(token)
        assert gone.wait(5.0)
        gone.clear()
        router.declare_live(token)
        assert not gone.wait(0.1)
        router.close()
        assert gone.wait(5.0)


def test_poses_of_others_are_heard_only_where_the_emulated_network_needs_them() -> None:
    plan = access.plan(RUN, ROBOTS, HEARS, ("r1",), located={"r2": ["r1"]})
    poses = {
        user: [key for key in rights.hears if key.endswith("/pose")]
        for user, rights in plan.rights.items()
        if user.startswith("agent-")
    }
    own = {f"agent-{robot}": [keys.pose(RUN, robot)] for robot in ROBOTS}
    own["agent-r2"].append(keys.pose(RUN, "r1"))
    assert poses == own
