"""Access control of a run, from its graph: keys that each identity may publish and receive.

The graph *is* the network. The router refuses everything that isn't listed (default deny), and each
process is bound to its identity by a random password that it alone is given. The rights of a role
are in its row of `configs.roles`: of an agent its own path, rows and inputs to put, and to hear the
paths of exactly its in-neighbours, and that there are none, its own pose, and leader/speed iff
h_i = 1. Every role that a run starts also puts progress, notices and its report. The viewer hears
rows, progress and notices of all, and puts nothing: what it asks, it asks at the run's door. Faults
are ordered by the launcher alone; in lockstep the plant hands orders on to controllers
(`bridge.network.fault_orders`). Besides the roles there are guests, clients of buses on other
machines: they put their lines up and hear their lines down; which buses they may open is the
relay's decision.

Plant and controllers may watch the launcher's token and hear its last word: on other machines that
is how they learn that the run is over, and why. A process on another machine has a password that
was agreed on before, or a certificate: the rules are bound to its common name, which says the
identity and for which of its keys (`configs.tls`). Then the password is that name once more: no
secret, but a client with a revoked key is refused at its login. The plant hears the poses of the
robots that it doesn't emulate.

A right has limits of length and rate: the router drops what is
longer than anything honest on that key (`bridge.network.messages.MOST_BYTES`). In real time, where
the newest wins, it also drops what comes faster than `MOST_PER_PERIOD` times as often as the
schedule says. In lockstep every message counts and two may arrive together, so there is no rate for
it to keep: there hearers keep but few of each (`bridge.network.zenoh_link.POLLED_DEPTH`), and
count, and of a controller that says far more than the ticks allow nothing more is taken
(`bridge.network.flood_guard`).

The launcher's own session is inside the router and isn't subject to the rules; at an external
router it has rights like the others. Flows are named from
the router's side: a process that publishes is an ingress put, and it must be told (egress
declare_subscriber) of a subscriber; a process that hears is an ingress declare_subscriber and
an egress put.
"""

import secrets
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from bridge.network import keys
from bridge.network.messages import MOST_BYTES
from configs.roles import AGENT, LAUNCHER, ROLES, Role, Topic, processes_of, takes_orders

MOST_PER_PERIOD = 8.0
"""Path states and poses of one robot within the period in which the schedule has one."""
LEAST_HZ = 100.0
"""No rate is limited below this: what comes in a burst isn't too much."""


@dataclass(frozen=True, slots=True)
class Rights:
    """What one identity may do: keys it may put and hear, its liveliness tokens, whose it sees."""

    puts: tuple[str, ...]
    hears: tuple[str, ...]
    tokens: tuple[str, ...]
    watches: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class AccessPlan:
    """Rights and passwords of a run."""

    rights: Mapping[str, Rights]
    passwords: Mapping[str, str] = field(repr=False)
    certified: frozenset[str] = frozenset()  # identities that must show a certificate
    most_hz: Mapping[str, float] = field(default_factory=dict)  # by key; others at any rate
    kept_out: Mapping[str, str] = field(default_factory=dict)  # identities without rights, and why
    expiries: Mapping[int, str] = field(default_factory=dict)
    """Identities of the authority's certificates, by their last second since 1970 UTC."""

    def dictionary(self) -> str:
        """Zenoh's user dictionary: `user:password` lines."""
        return "".join(f"{user}:{word}\n" for user, word in self.passwords.items())

    def access_control(self) -> dict[str, object]:
        """Zenoh's `access_control` section."""
        rules: list[dict[str, object]] = []
        policies = []
        for user, rights in self.rights.items():
            own = _rules_of(user, rights)
            rules += own
            policies.append({"rules": [rule["id"] for rule in own], "subjects": [user]})
        subjects = [
            {"id": user, "usernames": [user]}
            | ({"cert_common_names": [self.passwords[user]]} if user in self.certified else {})
            for user in self.rights
        ]
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": subjects,
            "policies": policies,
        }

    def low_pass_filter(self) -> list[dict[str, object]]:
        """Zenoh's `low_pass_filter` section: how long messages on each key may be."""
        by_limit: dict[int, list[str]] = {}
        for rights in self.rights.values():
            for key in rights.puts:
                if (limit := MOST_BYTES.get(keys.kind(key))) is not None:
                    by_limit.setdefault(limit, []).append(key)
        return [
            {
                "id": f"most-{limit}",
                "flows": ["ingress"],
                "messages": ["put"],
                "key_exprs": list(dict.fromkeys(allowed)),
                "size_limit": limit,
            }
            for limit, allowed in sorted(by_limit.items())
        ]

    def downsampling(self) -> list[dict[str, object]]:
        """Zenoh's `downsampling` section: how often messages on each key may come."""
        if not self.most_hz:
            return []
        rules = [{"key_expr": key, "freq": rate} for key, rate in self.most_hz.items()]
        limits = {"id": "most-often", "flows": ["ingress"], "messages": ["put"], "rules": rules}
        return [{**limits}]


def plan(
    run: str,
    robots: Sequence[str],
    hears: Mapping[str, Sequence[str]],
    leader: Sequence[str],
    *,
    buses: Sequence[str] = (),
    real_robots: Collection[str] = (),
    located: Mapping[str, Sequence[str]] | None = None,
    guests: Mapping[str, str] | None = None,
    bus_guests: Collection[str] = (),
    certified: bool = False,
    kept_out: Mapping[str, str] | None = None,
    external: bool = False,
    share_period_s: float | None = None,
    localisation_period_s: float | None = None,
) -> AccessPlan:
    """The rights of a run from its graph: `hears[i]` are the robots that i hears, `leader` h_i.

    What crosses the `buses` is recorded. `real_robots` aren't emulated: their poses come from the
    localisation system. `guests` are the passwords of identities on other machines (all others are
    given random ones), who must show a certificate with the password as its common name if
    `certified`. Identities that are `kept_out` have no rights, for the reason named. An `external`
    router is a program of its own, where the launcher is a client. Periods are of real time; with
    one, what comes much more often is dropped.
    """
    lockstep = share_period_s is None
    graph = _Graph(run, robots, hears, leader, buses, real_robots, located or {}, lockstep)
    rights: dict[str, Rights] = {}
    for role in ROLES:
        for robot in robots if role.per_robot else ("",):
            if external and role.on_request:
                continue  # it isn't started: a router of its own outlives who it was made for
            if role.module or graph.keys(role.puts, robot):
                rights[role.identity(robot)] = _rights(role, robot, graph)
    for user in bus_guests:
        rights[user] = Rights(
            puts=(keys.guest_lines("up", user),),
            hears=(keys.guest_lines("down", user),),
            tokens=(keys.guest_lines("alive", user),),
            watches=(keys.guest_relay(user),),
        )
    if external:
        rights[LAUNCHER.identity()] = _launcher(graph, bus_guests)
    known = dict(guests or {})
    passwords = {user: known.get(user) or secrets.token_urlsafe(24) for user in rights}
    most_hz = {
        key: max(MOST_PER_PERIOD / period_s, LEAST_HZ)
        for key_of, period_s in ((keys.path, share_period_s), (keys.pose, localisation_period_s))
        if period_s is not None
        for key in (key_of(run, robot) for robot in robots)
    }
    certificates = frozenset(known if certified else ())
    return AccessPlan(rights, passwords, certificates, most_hz, dict(kept_out or {}))


class _Graph(NamedTuple):
    """What the rights of a run depend on."""

    run: str
    robots: Sequence[str]
    hears: Mapping[str, Sequence[str]]
    leader: Sequence[str]
    buses: Sequence[str]
    measured: Collection[str]  # robots that aren't emulated
    located: Mapping[str, Sequence[str]]  # by robot, those whose poses its emulated network needs
    lockstep: bool

    def keys(self, topics: Iterable[Topic], robot: str) -> tuple[str, ...]:
        """The keys of these topics to a role's process; `robot` is its own."""
        return tuple(key for topic in topics for key in self._keys(topic, robot))

    def _keys(self, topic: Topic, robot: str) -> Iterable[str]:
        run = self.run
        if topic is Topic.GO:
            return [keys.go(run)]
        if topic in (Topic.PROGRESS, Topic.NOTICES):
            key_of_process = keys.progress if topic is Topic.PROGRESS else keys.notice
            return [key_of_process(run, process) for process in processes_of(tuple(self.robots))]
        if topic is Topic.LEADER_SPEED:
            return [keys.leader_speed(run)] if robot in self.leader else []
        if topic is Topic.ORDERS_OF_CONTROLLERS:
            controllers = map(AGENT.process, self.robots) if self.lockstep else ()
            return [keys.order(run, process) for process in controllers]
        emulated = [r for r in self.robots if r not in self.measured]
        measured = [r for r in self.robots if r in self.measured]
        key_of, names = {
            Topic.OWN_PATH: (keys.path, [robot]),
            Topic.OWN_POSE: (keys.pose, [robot]),
            Topic.OWN_TELEMETRY: (keys.telemetry, [robot]),
            Topic.OWN_INPUTS: (keys.inputs, [robot]),
            Topic.PATHS_OF_IN_NEIGHBOURS: (keys.path, self.hears.get(robot, ())),
            Topic.SILENCES_OF_IN_NEIGHBOURS: (keys.silence, self.hears.get(robot, ())),
            Topic.POSES_OF_LOCATED_NEIGHBOURS: (keys.pose, self.located.get(robot, ())),
            Topic.EMULATED_POSES: (keys.pose, emulated),
            Topic.MEASURED_POSES: (keys.pose, measured),
            Topic.SILENCES: (keys.silence, emulated),
            Topic.TRUTHS: (keys.truth, self.robots),
            Topic.TELEMETRIES: (keys.telemetry, self.robots),
            Topic.INPUTS: (keys.inputs, self.robots),
            Topic.TRAFFIC: (keys.traffic, self.buses),
        }[topic]
        return [key_of(run, name) for name in names]


def _rights(role: Role, robot: str, graph: _Graph) -> Rights:
    run, process = graph.run, role.process(robot)
    control: tuple[str, ...] = ()
    if role.module and not role.on_request:
        control = keys.progress(run, process), keys.notice(run, process), keys.report(run, process)
    reports = tuple(keys.report(run, other) for other in role.watches)
    if role.takes_orders:
        control, reports = (
            (*control, keys.answer(run, process)),
            (*reports, keys.order(run, process)),
        )
    if role.module and not role.beside_launcher:
        control, reports = (*control, keys.pong(run, process)), (*reports, keys.ping(run))
    return Rights(
        puts=(*graph.keys(role.puts, robot), *control),
        hears=(*graph.keys(role.hears, robot), *reports),
        tokens=(keys.live(run, process),),
        watches=tuple(keys.live(run, other) for other in role.watches),
    )


def _launcher(graph: _Graph, bus_guests: Iterable[str]) -> Rights:
    """Of a launcher that isn't the router: the operator's end of the control plane, the relay's."""
    run, users = graph.run, tuple(bus_guests)
    processes = processes_of(tuple(graph.robots))
    said = [of(run, it) for it in processes for of in (keys.progress, keys.notice, keys.report)]
    said += [keys.pong(run, process) for process in processes]
    own = [keys.go(run), keys.leader_speed(run), keys.report(run, LAUNCHER.name), keys.ping(run)]
    for process in filter(takes_orders, processes):
        own.append(keys.order(run, process))
        said.append(keys.answer(run, process))
    return Rights(
        puts=(*own, *(keys.guest_lines("down", user) for user in users)),
        hears=(*said, *(keys.guest_lines("up", user) for user in users)),
        tokens=(keys.live(run, LAUNCHER.name), *map(keys.guest_relay, users)),
        watches=(
            *(keys.live(run, process) for process in processes),
            *(keys.guest_lines("alive", user) for user in users),
        ),
    )


def _rules_of(user: str, rights: Rights) -> list[dict[str, object]]:
    def rule(
        name: str, messages: list[str], flow: str, key_exprs: Sequence[str]
    ) -> dict[str, object]:
        return {
            "id": f"{user}-{name}",
            "permission": "allow",
            "messages": messages,
            "flows": [flow],
            "key_exprs": list(key_exprs),
        }

    rules = [
        rule("puts", ["put"], "ingress", rights.puts),
        rule("learns", ["declare_subscriber"], "egress", rights.puts),
        rule("asks", ["declare_subscriber"], "ingress", rights.hears),
        rule("hears", ["put"], "egress", rights.hears),
        rule("lives", ["liveliness_token"], "ingress", rights.tokens),
    ]
    if rights.watches:
        rules += [
            rule("watches", ["declare_liveliness_subscriber"], "ingress", rights.watches),
            rule("sees", ["liveliness_token"], "egress", rights.watches),
        ]
    return [one for one in rules if one["key_exprs"]]  # Zenoh takes none without
