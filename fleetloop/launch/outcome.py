"""Outcome of a run over processes: counters for the summary, and the cause of its end."""

from dataclasses import dataclass, field
from typing import Any

from bridge.network.reports import Report
from configs.events import Event, EventLog
from configs.scenario import Scenario


@dataclass(slots=True)
class Outcome:
    """The launcher's account of a run."""

    ended: str = "completed"  # "completed", "interrupted", "aborted"
    reason: str = ""
    timed: bool = True  # the reason says when
    ticks: int = 0
    wall_s: float = 0.0
    startup_s: float = 0.0
    teardown_s: float = 0.0
    cpu_ns: int = 0  # of the launcher, from the first tick on
    reports: dict[str, Report] = field(default_factory=dict)
    said: dict[str, EventLog] = field(default_factory=dict)  # by a process, as they came
    faults: list[dict[str, Any]] = field(default_factory=list)  # of `fleetloop.launch.fault_ledger`
    steered: Scenario | None = None
    """The scenario with the steps of v_r that were ordered; None: none was."""
    former: dict[str, list[Event]] = field(default_factory=dict)
    """By controllers whose process was replaced, as they came."""
    events: dict[str, EventLog] = field(default_factory=dict)  # of a process, as observed here
    remarks: dict[str, list[str]] = field(default_factory=dict)  # of launcher and router
    clocks: dict[str, dict[str, float]] = field(default_factory=dict)
    """Offsets of other machines' clocks, by process (`fleetloop.launch.clock_offsets`)."""
    refused: dict[str, dict[str, int]] = field(default_factory=dict)
    """How often the router refused an identity, by kind (`bridge.network.router_refusals`)."""
    machine: dict[str, Any] = field(default_factory=dict)
