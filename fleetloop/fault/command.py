"""`fleetloop fault [RUN] list | inject | clear`: asks a run through its door."""

from collections.abc import Mapping, Sequence
from typing import Any

import tomli_w
from rich.table import Table

from configs.errors import ScenarioError
from configs.overrides import Override
from fleetloop.door.client import open_run
from fleetloop.terminal import ResultConsole, note, say, say_json


def list_faults(run: str, *, as_json: bool, as_toml: bool) -> None:
    """Print the faults of a run.

    Raises:
        ScenarioError: there is no such run.
        InfrastructureError: it doesn't answer.
    """
    with open_run(run) as client:
        said = client.ask("fault.list")
        name = client.run
    faults = said["faults"]
    if as_toml:
        say(tomli_w.dumps({"fault": said["tables"]}).rstrip())
    elif as_json:
        say_json({"run": name} | said)
    elif faults:
        ResultConsole().print_whole(_table(faults))
    else:
        note(f"{name}: no faults, at t = {said['t_s']:.3f} s")


def inject_fault(
    run: str, table: dict[str, Any], parameters: Sequence[str], *, as_json: bool, force: bool
) -> None:
    """Order a fault and print from which tick on it acts.

    Raises:
        ScenarioError: there is no such run, or it refuses the fault.
        InfrastructureError: it doesn't answer.
    """
    for text in parameters:
        one = Override.from_set(text)
        if not isinstance(one, Override):
            raise ScenarioError(f"--set {text}: {one.remedy}")
        table[one.key] = one.value
    with open_run(run) as client, client.controlled("fleetloop fault", force=force):
        fault = client.ask("fault.inject", fault=table)["fault"]
    if as_json:
        say_json(fault)
    else:
        applied = "planned for" if fault["state"] == "planned" else "applied at"
        say(f"{_named(fault)}: {applied} {_when(fault, 'from')}{_late(fault)}")


def clear_faults(run: str, names: Sequence[str], *, as_json: bool, force: bool) -> None:
    """Order the end of faults, of all if none is named, and print at which tick they end.

    Raises:
        ScenarioError: there is no such run, or no such fault.
        InfrastructureError: it doesn't answer.
    """
    with open_run(run) as client, client.controlled("fleetloop fault", force=force):
        cleared = client.ask("fault.clear", names=list(names))["cleared"]
    if as_json:
        say_json(cleared)
    else:
        for fault in cleared:
            say(f"{_named(fault)}: cleared at {_when(fault, 'to')}")
        if not cleared:
            note("no fault acts, and none is planned")


def _table(faults: Sequence[Mapping[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in ("fault", "kind", "on", "parameters", "state", "from", "to", "from the"):
        table.add_column(column, no_wrap=True)
    for one in faults:
        parameters = {key: it for key, it in one["parameters"].items() if it is not None}
        parameters.pop("edges", None)
        table.add_row(
            one["name"],
            one["kind"],
            ", ".join(one["targets"]),
            ", ".join(f"{key}={it}" for key, it in parameters.items()),
            one["state"],
            _when(one, "from"),
            "-" if one["to_tick"] is None else _when(one, "to"),
            "operator" if one["ordered"] else "scenario",
        )
    return table


def _named(fault: Mapping[str, Any]) -> str:
    kind = "" if fault["name"] == fault["kind"] else f" ({fault['kind']})"
    return f"{fault['name']}{kind} on {', '.join(fault['targets'])}"


def _when(fault: Mapping[str, Any], end: str) -> str:
    return f"tick {fault[f'{end}_tick']} (t = {fault[f'{end}_s']:.3f} s)"


def _late(fault: Mapping[str, Any]) -> str:
    late = ", ".join(
        f"{process} at tick {tick}" for process, tick in fault.get("ticks", {}).items()
    )
    return f"; late: {late}" if late else ""
