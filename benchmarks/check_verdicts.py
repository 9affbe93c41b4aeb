"""Verdicts of `fleetloop check` on random scenarios against what their runs do.

Draws a graph, weights, gains, rates, an emulated network, drives with their limits, a path and
starts; asks the check, without its rehearsal, and runs the scenario in this process. A run works if
no robot stops and over its last seconds robots are on their paths, abreast, at the leader's speed.
The draw knows nothing of the check. Scenario N is the same whenever it is drawn.
"""

import argparse
import math
import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from random import Random
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from configs.errors import ScenarioError
from configs.loading import loads
from configs.scenario import Scenario
from fleetloop.check.examine import examine
from fleetloop.check.finding import titled, worst
from fleetloop.check.rehearsal import Rehearsal, rehearsal
from fleetloop.settling import FINAL_S, SETTLE_BAND

DURATION_S = 30.0
LEVELS = ("ok", "warning", "error")
REFUSED = "refused"
INERTIA_KG_M2 = 0.0072
"""About min(m̄) of the paper's robot, for the gain that suits a rate."""


class Verdict(NamedTuple):
    """One scenario: the check's level and reasons, and the faults of its run, none if it works."""

    number: int
    level: str
    reasons: tuple[str, ...]
    faults: tuple[str, ...]


def drawn(number: int, *, ideal: bool = False) -> str:
    """The scenario file of a number; `ideal`: with ideal drives, all else the same."""
    draw = Random(f"scenario {number}")
    period_s = draw.choice((0.01, 0.02, 0.02))
    robots = [f"r{n + 1}" for n in range(draw.randint(2, 4))]
    speed = round(draw.uniform(0.2, 0.8), 2)
    data: dict[str, Any] = {
        "schema": 1,
        "name": f"random_{number}",
        "duration_s": DURATION_S,
        "seed": number + 1,
        "clock": {
            "control_period_s": period_s,
            "share_period_s": draw.choice((0.02, 0.06, 0.1, 0.2, 0.5, 1.0)),
            "localisation_period_s": 0.02,
            "plant_step_s": period_s / 2,
            "countdown_s": 0.6,
        },
        "leader": {"speed_m_s": speed},
        "graph": _graph(draw, robots),
        "control": _control(draw, period_s),
        "coordination": {
            "p": _log_uniform(draw, 0.3, 4.0),
            "q": _log_uniform(draw, 0.3, 3.0),
            "v_hat_0": draw.choice((0.0, speed)),
            "compensation": draw.choice(("extrapolate", "extrapolate", "hold", "both")),
        },
        "drive": _drive(draw),
        "mounting": {"gear_ratio": _log_uniform(draw, 0.3, 4.0)},
    }
    if draw.random() < 0.6:
        data["network"] = _network(draw, data["graph"]["edges"])
    if ideal:
        data["drive"]["preset"] = "ideal"
    path, places, heading = _path(draw, len(robots))
    data["path"] = path
    data["robot"] = [
        {
            "name": name,
            "pose": {
                "x_m": x + draw.uniform(-0.3, 0.3),
                "y_m": y + draw.uniform(-0.3, 0.3),
                "theta_rad": heading + draw.uniform(-0.5, 0.5),
            },
            "s_0": draw.uniform(-0.3, 0.3),
            "offset": offset,
        }
        for name, (x, y, offset) in zip(robots, places, strict=True)
    ]
    return tomli_w.dumps(data)


def _log_uniform(draw: Random, low: float, high: float) -> float:
    return round(math.exp(draw.uniform(math.log(low), math.log(high))), 3)


def _graph(draw: Random, robots: list[str]) -> dict[str, Any]:
    if draw.random() < 0.75:  # rooted: a tree and some more
        edges = {(draw.choice(robots[:n]), robots[n]) for n in range(1, len(robots))}
        more = 0.25
    else:
        edges, more = set(), 0.4
    edges |= {(a, b) for a in robots for b in robots if a != b and draw.random() < more}
    texts = [f"{a} -> {b}" for a, b in sorted(edges)]
    graph: dict[str, Any] = {"edges": texts, "leader": robots[:1]}
    if draw.random() < 0.3:
        graph["leader"] = sorted(draw.sample(robots, draw.randint(1, 2)))
    kind = draw.choice(("unit", "unit", "normalised", "table"))
    if kind == "normalised":
        graph["weights"] = kind
    elif kind == "table" and texts:
        graph["weights"] = {text: round(draw.uniform(0.3, 2.0), 2) for text in texts}
    return graph


def _control(draw: Random, period_s: float) -> dict[str, Any]:
    off = _log_uniform(draw, 0.3, 6.0) if draw.random() < 0.3 else 1.0
    lag_s = round(draw.choice((5, 5, 10)) * period_s, 3)
    return {
        "law": "adaptive_dsc_robust",
        "k4": round(off * 0.25 * INERTIA_KG_M2 / period_s, 4),
        **{f"gamma_{n}_s": lag_s for n in (1, 2, 3)},
    }


def _drive(draw: Random) -> dict[str, Any]:
    preset = draw.choice(("ideal", "limited", "limited", "realistic"))
    return {
        "preset": preset,
        "current_limit_A": _log_uniform(draw, 2.0, 30.0),
        "velocity_limit_shaft_rev_s": _log_uniform(draw, 2.0, 40.0),
    }


def _network(draw: Random, edges: list[str]) -> dict[str, Any]:
    effects: dict[str, Any] = {}
    longest_s = draw.choice((0.2, 1.0, 2.5))
    match draw.choice(("none", "constant", "uniform", "lognormal")):
        case "constant":
            delay_s = round(draw.uniform(0.0, longest_s), 3)
            effects["delay"] = {"kind": "constant", "delay_s": delay_s}
        case "uniform":
            low_s = round(draw.uniform(0.0, longest_s), 3)
            effects["delay"] = {"kind": "uniform", "min_s": low_s, "max_s": low_s + 0.3}
        case "lognormal":
            mean_s = round(draw.uniform(0.01, longest_s), 3)
            effects["delay"] = {"kind": "lognormal", "mean_s": mean_s, "std_s": 0.3 * mean_s}
    match draw.choice(("none", "bernoulli", "gilbert_elliott")):
        case "bernoulli":
            probability = round(draw.uniform(0.0, 0.95), 2)
            effects["loss"] = {"kind": "bernoulli", "probability": probability}
        case "gilbert_elliott":
            effects["loss"] = {
                "kind": "gilbert_elliott",
                "good_to_bad": round(draw.uniform(0.02, 0.5), 3),
                "bad_to_good": round(draw.uniform(0.05, 0.8), 3),
            }
    network: dict[str, Any] = {"default": effects}
    if edges and draw.random() < 0.2:
        loss = {"kind": "bernoulli", "probability": draw.choice((0.5, 0.9, 1.0))}
        network["edge"] = [{"edges": [draw.choice(edges)], "loss": loss}]
    return network


def _path(draw: Random, count: int) -> tuple[dict[str, Any], list[tuple[Any, ...]], float]:
    """The path, each robot's start on it with its offset, and the heading there."""
    apart_m = round(draw.uniform(0.5, 1.0), 2)
    match draw.choice(("line", "circle", "cosine")):
        case "line":
            offsets = [{"kind": "world", "y_m": n * apart_m} for n in range(count)]
            places = [(0.0, n * apart_m, offsets[n]) for n in range(count)]
            return {"kind": "line"}, places, 0.0
        case "cosine":
            offsets = [{"kind": "world", "y_m": n * apart_m} for n in range(count)]
            places = [(0.0, 1.0 + n * apart_m, offsets[n]) for n in range(count)]
            return {"kind": "cosine"}, places, 0.0
        case _:
            radius_m = round(draw.uniform(3.0, 8.0), 2)
            offsets = [{"kind": "structure", "left_m": -n * apart_m} for n in range(count)]
            places = [(radius_m + n * apart_m, 0.0, offsets[n]) for n in range(count)]
            return {"kind": "circle", "radius_m": radius_m}, places, 0.5 * math.pi


def verdict(number: int, *, ideal: bool = False) -> Verdict:
    """Check and run one scenario."""
    name = f"random_{number}"
    try:
        scenario = loads(name, drawn(number, ideal=ideal))
        findings = examine(name, scenario)
    except ScenarioError as error:
        return Verdict(number, REFUSED, tuple(str(error).splitlines()), ("not run",))
    level = worst(findings)
    reasons = tuple(titled(one) for one in findings if one.level == level != "ok")
    return Verdict(number, level, reasons, faults(scenario, rehearsal(scenario, DURATION_S)))


def faults(scenario: Scenario, run: Rehearsal) -> tuple[str, ...]:
    """What is wrong at the end of a run."""
    if run.failed:
        return (run.failed,)
    found = [f"{robot} stops: {reason}" for robot, reason in run.stopped.items()]
    last = round(FINAL_S / scenario.clock.control_period_s)
    rows = [run.rows[name][-last:] for name in scenario.names]
    if found or min(map(len, rows)) == 0:
        return tuple(found) or ("no rows",)
    s = np.stack([part["s"] for part in rows])
    worst_of = {
        "spread of s": np.ptp(s, axis=0).max(),
        "v_hat": max(np.abs(part["v_r_hat"] - scenario.leader.speed_m_s).max() for part in rows),
        "x_e": max(np.abs(part["x_e_m"]).max() for part in rows),
        "y_e": max(np.abs(part["y_e_m"]).max() for part in rows),
    }
    return tuple(f"{name} {value:.3g}" for name, value in worst_of.items() if value > SETTLE_BAND)


def table(verdicts: Iterable[Verdict]) -> Iterator[str]:
    """Verdict against outcome, as Markdown."""
    counts = Counter((one.level, not one.faults) for one in verdicts)
    refused = counts.pop((REFUSED, False), 0)
    total = sum(counts.values())
    yield "| check says | run works | run fails |"
    yield "| --- | --- | --- |"
    for level in LEVELS:
        yield f"| {level} | {counts[level, True]} | {counts[level, False]} |"
    yield ""
    fails = counts["ok", False]
    called = max(counts["ok", True] + fails, 1)
    yield f"{total} scenarios; of those called ok {fails} fail, {fails / called:.1%}"
    yield f"{refused} more were refused when they were loaded"


def false_verdicts(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Ok and fails, or an error and works."""
    return [
        one for one in verdicts if (one.level, not one.faults) in (("ok", False), ("error", True))
    ]


def main() -> None:
    """Draw, check, run; print the table and the disagreements."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=500, help="scenarios (default: 500)")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--ideal", action="store_true", help="ideal drives: coordination alone")
    parser.add_argument("--quick", action="store_true", help="20 scenarios")
    options = parser.parse_args()
    count = 20 if options.quick else options.count
    numbers = range(options.first, options.first + count)
    verdicts = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for one in pool.map(partial(verdict, ideal=options.ideal), numbers):
            verdicts.append(one)
            print(*one, sep="; ", file=sys.stderr, flush=True)
    print(*table(verdicts), sep="\n")
    for one in false_verdicts(verdicts):
        print(f"{one.number}: {one.level} {one.reasons}, {one.faults or 'works'}")


if __name__ == "__main__":
    main()
