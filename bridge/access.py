"""Graph → who may say and hear what: the router's access control and everybody's credentials.

The graph *is* the network. The router refuses everything that isn't listed here (default deny), and
each process is bound to its identity by a random password that it alone is given:

    agent-<r>   puts   its own path, telemetry, progress, report; its own token
                hears  path of exactly its in-neighbours, its own pose, leader/speed iff h_i = 1,
                       @clock/go
    plant       puts   pose and truth of all robots, progress, report; its token
                hears  @clock/go
    recorder    puts   progress, report; its token
                hears  truth and telemetry of all robots

The launcher's own session is inside the router and isn't subject to the rules. Flows are named from
the router's side: a process that publishes is an ingress put, and it must be told (egress
declare_subscriber) that somebody listens; a process that hears is an ingress declare_subscriber and
an egress put.
"""

import json
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from bridge import keys

PLANT = "plant"
RECORDER = "recorder"


def agent_user(robot: str) -> str:
    """The identity of a robot's controller."""
    return f"agent-{robot}"


@dataclass(frozen=True, slots=True)
class Rights:
    """What one identity may do: keys it may put, keys it may hear, its liveliness token."""

    puts: tuple[str, ...]
    hears: tuple[str, ...]
    token: str


@dataclass(frozen=True, slots=True)
class AccessPlan:
    """Rights and passwords of a run."""

    rights: Mapping[str, Rights]
    passwords: Mapping[str, str] = field(repr=False)

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
        subjects = [{"id": user, "usernames": [user]} for user in self.rights]
        return json.dumps(
            {
                "enabled": True,
                "default_permission": "deny",
                "rules": rules,
                "subjects": subjects,
                "policies": policies,
            }
        )


def plan(
    run: str, robots: Sequence[str], hears: Mapping[str, Sequence[str]], leader: Sequence[str]
) -> AccessPlan:
    """The rights of a run from its graph: `hears[i]` are the robots that i hears, `leader` h_i."""
    rights: dict[str, Rights] = {}
    for robot in robots:
        process = f"agent/{robot}"
        heard = [keys.path(run, other) for other in hears[robot]]
        if robot in leader:
            heard.append(keys.leader_speed(run))
        rights[agent_user(robot)] = Rights(
            puts=(keys.path(run, robot), keys.telemetry(run, robot), *_control(run, process)),
            hears=(keys.pose(run, robot), keys.go(run), *heard),
            token=keys.live(run, process),
        )
    truths = [keys.truth(run, robot) for robot in robots]
    rights[PLANT] = Rights(
        puts=(*(keys.pose(run, robot) for robot in robots), *truths, *_control(run, PLANT)),
        hears=(keys.go(run),),
        token=keys.live(run, PLANT),
    )
    rights[RECORDER] = Rights(
        puts=_control(run, RECORDER),
        hears=(*truths, *(keys.telemetry(run, robot) for robot in robots)),
        token=keys.live(run, RECORDER),
    )
    return AccessPlan(rights, {user: secrets.token_urlsafe(24) for user in rights})


def _control(run: str, process: str) -> tuple[str, str]:
    return keys.progress(run, process), keys.report(run, process)


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

    return [
        rule("puts", ["put"], "ingress", rights.puts),
        rule("learns", ["declare_subscriber"], "egress", rights.puts),
        rule("asks", ["declare_subscriber"], "ingress", rights.hears),
        rule("hears", ["put"], "egress", rights.hears),
        rule("lives", ["liveliness_token"], "ingress", [rights.token]),
    ]
