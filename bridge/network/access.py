"""Graph → who may say and hear what: the router's access control and everybody's credentials.

The graph *is* the network. The router refuses everything that isn't listed here (default deny), and
each process is bound to its identity by a random password that it alone is given:

    agent-<r>   puts   its own path, telemetry, progress, notices, report; its own token
                hears  path of exactly its in-neighbours, its own pose, leader/speed iff h_i = 1,
                       @clock/go
    plant       puts   pose and truth of all robots, traffic of all buses, progress, notices,
                       report; its token
                hears  @clock/go
    recorder    puts   progress, notices, report; its token
                hears  truth and telemetry of all robots, traffic of all buses
    localisation       only with robots that aren't emulated:
                puts   their poses
                hears  @clock/go

    a guest            a client of buses on another machine
                puts   its lines up, its token; which buses it may open is the relay's to say
                hears  its lines down
                sees   the token of the relay

Plant and controllers may watch the launcher's token and hear its last word: on other machines that
is how they learn that the run is over, and why. Who comes from another machine has a password that
was agreed on before, or a certificate whose common name is the identity; then the password is no
secret and proves nothing. The plant hears the poses of the robots that it doesn't emulate.

Whoever may say something may still not say it at any length or rate: the router drops what is
longer than anything honest on that key (`bridge.network.messages.MOST_BYTES`). In real time, where
the newest wins, it also drops what comes faster than `MOST_PER_PERIOD` times as often as the
schedule says. In lockstep every message counts and two may arrive together, so there is no rate for
it to keep: there hearers keep but few of each (`bridge.network.zenoh_link.POLLED_DEPTH`), and
count, and of a controller that says far more than the ticks allow nothing more is taken
(`bridge.network.floods`).

The launcher's own session is inside the router and isn't subject to the rules. Flows are named from
the router's side: a process that publishes is an ingress put, and it must be told (egress
declare_subscriber) that somebody listens; a process that hears is an ingress declare_subscriber and
an egress put.
"""

import json
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from bridge.network import keys
from bridge.network.messages import MOST_BYTES

MOST_PER_PERIOD = 8.0
"""Path states and poses of one robot within the period in which the schedule has one."""
LEAST_HZ = 100.0
"""No rate is limited below this: what comes in a burst isn't too much."""
PLANT = "plant"
RECORDER = "recorder"
LAUNCHER = "launcher"
LOCALISATION = "localisation"


def agent_user(robot: str) -> str:
    """The identity of a robot's controller."""
    return f"agent-{robot}"


def user_of(role: str) -> str:
    """The identity of a role: plant, recorder, agent/<robot>."""
    return role.replace("/", "-")


@dataclass(frozen=True, slots=True)
class Rights:
    """What one identity may do: keys it may put and hear, its liveliness token, whose it sees."""

    puts: tuple[str, ...]
    hears: tuple[str, ...]
    token: str
    watches: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class AccessPlan:
    """Rights and passwords of a run."""

    rights: Mapping[str, Rights]
    passwords: Mapping[str, str] = field(repr=False)
    certified: frozenset[str] = frozenset()  # identities that must show a certificate
    most_hz: Mapping[str, float] = field(default_factory=dict)  # by key; others at any rate

    def dictionary(self) -> str:
        """Zenoh's user dictionary: `user:password` lines."""
        return "".join(f"{user}:{word}\n" for user, word in self.passwords.items())

    def access_control(self) -> str:
        """Zenoh's `access_control` section as JSON."""
        rules: list[dict[str, object]] = []
        policies = []
        for user, rights in self.rights.items():
            own = _rules_of(user, rights)
            rules += own
            policies.append({"rules": [rule["id"] for rule in own], "subjects": [user]})
        subjects = [
            {"id": user, "usernames": [user]}
            | ({"cert_common_names": [user]} if user in self.certified else {})
            for user in self.rights
        ]
        return json.dumps(
            {
                "enabled": True,
                "default_permission": "deny",
                "rules": rules,
                "subjects": subjects,
                "policies": policies,
            }
        )

    def low_pass_filter(self) -> str:
        """Zenoh's `low_pass_filter` section as JSON: how long messages on each key may be."""
        by_limit: dict[int, list[str]] = {}
        for rights in self.rights.values():
            for key in rights.puts:
                by_limit.setdefault(MOST_BYTES[keys.kind(key)], []).append(key)
        return json.dumps(
            [
                {
                    "id": f"most-{limit}",
                    "flows": ["ingress"],
                    "messages": ["put"],
                    "key_exprs": list(dict.fromkeys(allowed)),
                    "size_limit": limit,
                }
                for limit, allowed in sorted(by_limit.items())
            ]
        )

    def downsampling(self) -> str:
        """Zenoh's `downsampling` section as JSON: how often messages on each key may come."""
        if not self.most_hz:
            return "[]"
        rules = [{"key_expr": key, "freq": rate} for key, rate in self.most_hz.items()]
        limits = {"id": "most-often", "flows": ["ingress"], "messages": ["put"], "rules": rules}
        return json.dumps([limits])


def plan(
    run: str,
    robots: Sequence[str],
    hears: Mapping[str, Sequence[str]],
    leader: Sequence[str],
    *,
    buses: Sequence[str] = (),
    real_robots: Collection[str] = (),
    guests: Mapping[str, str] | None = None,
    bus_guests: Collection[str] = (),
    certified: bool = False,
    share_period_s: float | None = None,
    localisation_period_s: float | None = None,
) -> AccessPlan:
    """The rights of a run from its graph: `hears[i]` are the robots that i hears, `leader` h_i.

    What crosses the `buses` is recorded. `real_robots` aren't emulated: their poses come from the
    localisation system. `guests` are the passwords of identities on other machines (all others are
    given random ones), who must show a certificate with their identity as its common name if
    `certified`. Periods are of real time; with one, what comes much more often is dropped.
    """
    rights: dict[str, Rights] = {}
    launcher, its_word = (keys.live(run, LAUNCHER),), keys.report(run, LAUNCHER)
    for robot in robots:
        process = f"agent/{robot}"
        heard = [keys.path(run, other) for other in hears[robot]]
        if robot in leader:
            heard.append(keys.leader_speed(run))
        rights[agent_user(robot)] = Rights(
            puts=(keys.path(run, robot), keys.telemetry(run, robot), *_control(run, process)),
            hears=(keys.pose(run, robot), keys.go(run), its_word, *heard),
            token=keys.live(run, process),
            watches=launcher,
        )
    truths = [keys.truth(run, robot) for robot in robots]
    truths += [keys.traffic(run, bus) for bus in buses]
    poses = [keys.pose(run, robot) for robot in robots if robot not in real_robots]
    real_poses = [keys.pose(run, robot) for robot in robots if robot in real_robots]
    rights[PLANT] = Rights(
        puts=(*poses, *truths, *_control(run, PLANT)),
        hears=(keys.go(run), its_word, *real_poses),
        token=keys.live(run, PLANT),
        watches=launcher,
    )
    if real_poses:
        rights[LOCALISATION] = Rights(
            puts=tuple(real_poses), hears=(keys.go(run),), token=keys.live(run, LOCALISATION)
        )
    rights[RECORDER] = Rights(
        puts=_control(run, RECORDER),
        hears=(*truths, *(keys.telemetry(run, robot) for robot in robots)),
        token=keys.live(run, RECORDER),
    )
    for user in bus_guests:
        rights[user] = Rights(
            puts=(keys.guest_lines("up", user),),
            hears=(keys.guest_lines("down", user),),
            token=keys.guest_lines("alive", user),
            watches=(keys.guest_relay(user),),
        )
    known = dict(guests or {})
    passwords = {user: known.get(user) or secrets.token_urlsafe(24) for user in rights}
    most_hz = {
        key: max(MOST_PER_PERIOD / period_s, LEAST_HZ)
        for key_of, period_s in ((keys.path, share_period_s), (keys.pose, localisation_period_s))
        if period_s is not None
        for key in (key_of(run, robot) for robot in robots)
    }
    return AccessPlan(rights, passwords, frozenset(known if certified else ()), most_hz)


def _control(run: str, process: str) -> tuple[str, ...]:
    return keys.progress(run, process), keys.notice(run, process), keys.report(run, process)


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
        rule("lives", ["liveliness_token"], "ingress", [rights.token]),
    ]
    if rights.watches:
        rules += [
            rule("watches", ["declare_liveliness_subscriber"], "ingress", rights.watches),
            rule("sees", ["liveliness_token"], "egress", rights.watches),
        ]
    return rules
