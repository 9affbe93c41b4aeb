"""`fleetloop steer [RUN] VERB`: asks a run through its door."""

from collections.abc import Callable, Mapping
from typing import Any

import tomli_w
from rich.table import Table

from fleetloop.door.client import open_run
from fleetloop.terminal import ResultConsole, say, say_json

WHO = "fleetloop steer"
ESTOP = "drive_estop"
"""The kind of fault that trips the e-stop of drives."""


def steer(
    run: str, request: str, arguments: Mapping[str, Any], *, force: bool, as_json: bool
) -> None:
    """Ask a run for a change, and print what comes of it.

    Raises:
        ScenarioError: there is no such run, or it refuses.
        InfrastructureError: it doesn't answer.
    """
    with open_run(run) as client, client.controlled(WHO, force=force):
        said = client.ask(request, **arguments)
        name = client.run
    if as_json:
        say_json({"run": name} | said)
    else:
        say(f"{name}: {_IN_WORDS[request](said)}")


def stop_drives(run: str, *, force: bool, as_json: bool) -> None:
    """Trip the e-stop of all drives of a run, and print when.

    Raises:
        ScenarioError: there is no such run, or it refuses.
        InfrastructureError: it doesn't answer.
    """
    with open_run(run) as client, client.controlled(WHO, force=force):
        fault = client.ask("fault.inject", fault={"kind": ESTOP})["fault"]
        name = client.run
    if as_json:
        say_json({"run": name, "fault": fault})
    else:
        robots = ", ".join(fault["targets"])
        when = _at(fault["from_tick"], fault["from_s"])
        say(f"{name}: e-stop of the drives of {robots} at {when}")


def print_status(run: str, *, as_json: bool) -> None:
    """Print how far a run is, and its processes.

    Raises:
        ScenarioError: there is no such run.
        InfrastructureError: it doesn't answer.
    """
    with open_run(run) as client:
        said = client.ask("run.status")
        name = client.run
    if as_json:
        say_json({"run": name} | said)
        return
    say(f"{name}: {_how(said)}")
    table = Table(box=None, pad_edge=False)
    for column in ("process", "state", "tick", "processors", ""):
        table.add_column(column, no_wrap=True)
    for one in said["processes"]:
        cpu = "-" if one["cpu"] is None else f"{one['cpu']:.2f}"
        tick = "-" if one["tick"] is None else str(one["tick"])
        waited = "waited for" if one["waited_for"] else ""
        table.add_row(one["name"], one["state"], tick, cpu, waited)
    ResultConsole().print_whole(table)


def print_leader(run: str, *, as_toml: bool, as_json: bool) -> None:
    """Print the speed of the leader and its steps.

    Raises:
        ScenarioError: there is no such run.
        InfrastructureError: it doesn't answer.
    """
    with open_run(run) as client:
        leader = client.ask("run.leader")["leader"]
        name = client.run
    if as_json:
        say_json({"run": name, "leader": leader})
    elif as_toml:
        say(tomli_w.dumps({"leader": leader}).rstrip())
    else:
        say(f"{name}: v_r = {leader['speed_m_s']:g} m/s at first")
        for one in leader["steps"]:
            ramp = f", within {one['ramp_s']:g} s" if one.get("ramp_s") else ""
            say(f"  {one['speed_m_s']:g} m/s from t = {one['t_s']:.3f} s on{ramp}")


def _how(said: Mapping[str, Any]) -> str:
    """The state of a run in a line."""
    until = f"t = {said['t_s']:.3f} s of {said['ends_at_s']:g} s"
    parts = [f"{said['state']} at tick {said['tick']} ({until})"]
    if said["clock"] == "realtime":
        parts.append("real time")
    elif said["speed"]:
        parts.append(f"held to {said['speed']:g} times real time")
    if said["real_time_factor"] is not None:
        parts.append(f"{said['real_time_factor']:.2f} times real time now")
    parts.append(f"v_r = {said['leader_speed_m_s']:g} m/s")
    if said["controller"]:
        parts.append(f"{said['controller']} has the controls")
    return ", ".join(parts)


def _from(tick: int, t_s: float) -> str:
    return f"from {_at(tick, t_s)} on"


def _at(tick: int, t_s: float) -> str:
    return f"tick {tick} (t = {t_s:.3f} s)"


def _paused(said: Mapping[str, Any]) -> str:
    return f"paused at {_at(said['tick'], said['t_s'])}"


def _sped(said: Mapping[str, Any]) -> str:
    how = f"held to {said['speed']:g} times real time" if said["speed"] else "as fast as it can"
    return f"{how} {_from(said['tick'], said['t_s'])}"


def _led(said: Mapping[str, Any]) -> str:
    to = f"goes to {said['speed_m_s']:g} m/s within {said['ramp_s']:g} s"
    how = to if said["ramp_s"] else f"= {said['speed_m_s']:g} m/s"
    late = ", ".join(f"{process} at tick {tick}" for process, tick in said.get("late", {}).items())
    refused = "; ".join(f"{process}: {why}" for process, why in said.get("refused", {}).items())
    text = f"v_r {how} {_from(said['tick'], said['t_s'])}"
    return "; ".join(part for part in (text, late and f"late: {late}", refused) if part)


_IN_WORDS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "run.pause": _paused,
    "run.step": _paused,
    "run.resume": lambda said: f"goes on {_from(said['tick'], said['t_s'])}",
    "run.speed": _sped,
    "run.leader_speed": _led,
    "run.stop": lambda said: f"ends at about {_at(said['tick'], said['t_s'])}",
}
