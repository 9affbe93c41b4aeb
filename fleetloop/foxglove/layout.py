"""`layout.json` of a run's folder: panels for its record, or for the run itself, to be imported.

In the form that both Foxglove and Lichtblick import: the configuration of each panel under its
type and a key of its own, and a tree of splits. The plane with robots, references, edges and paths;
plots of path following errors, differences of path variables and torques; the log.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from configs.scenario import Scenario
from configs.signals import PATH_ERRORS, SENT_SIGNALS
from fleetloop.record.scene import WORLD
from fleetloop.record.schema import FLEET_SIGNALS, VIEW_TOPICS, Kind, View, topic
from fleetloop.results.palette import robot_style

SCENES = (View.PATHS, View.ROBOTS, View.REFERENCES, View.EDGES)
LOG_PANEL = "RosOut!events"
"""The type of log panels has kept its first name in layouts of this form."""
MOST_ROBOTS = 12
"""Of whose rows there are plots, the first ones of the scenario."""
_TITLES = ("foxglovePanelTitle", "lichtblickPanelTitle")
"""Keys of a panel's title, of either program."""


def layout_of(scenario: Scenario) -> str:
    """The file for a scenario."""
    return json.dumps(_layout(scenario), indent=1, ensure_ascii=False) + "\n"


def _layout(scenario: Scenario) -> dict[str, Any]:
    x_e, y_e, theta_e = (signal.name for signal in PATH_ERRORS)
    right, left = (signal.name for signal in SENT_SIGNALS[:2])
    plots = {
        "Plot!position_errors": _errors(scenario, "Path following errors x_e, y_e [m]", (x_e, y_e)),
        "Plot!heading_errors": _errors(scenario, "Path following errors θ_e [rad]", (theta_e,)),
        "Plot!s_differences": _differences(scenario),
        "Plot!torques": _errors(scenario, "Torques commanded at the wheels [N·m]", (right, left)),
    }
    panels = {
        "3D!plane": _plane(scenario),
        **plots,
        LOG_PANEL: {
            "topicToRender": VIEW_TOPICS[View.LOG],
            "minLogLevel": 1,
            "searchTerms": [],
            **dict.fromkeys(_TITLES, "Events"),
        },
    }
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": _split(("3D!plane", LOG_PANEL), 75),
            "second": _stack(tuple(plots)),
            "splitPercentage": 50,
        },
    }


def _split(panels: tuple[str, str], percentage: float) -> dict[str, Any]:
    first, second = panels
    return {
        "direction": "column",
        "first": first,
        "second": second,
        "splitPercentage": percentage,
    }


def _stack(panels: tuple[str, ...]) -> Any:
    """Panels of equal height."""
    if len(panels) == 1:
        return panels[0]
    return {
        "direction": "column",
        "first": panels[0],
        "second": _stack(panels[1:]),
        "splitPercentage": 100 / len(panels),
    }


def _plane(scenario: Scenario) -> dict[str, Any]:
    """The plane from above; x to the right."""
    places = [(robot.pose.x_m, robot.pose.y_m) for robot in scenario.robot]
    x_m, y_m = (sum(values) / len(places) for values in zip(*places, strict=True))
    extent_m = max(max(abs(x - x_m), abs(y - y_m)) for x, y in places)
    return {
        "cameraState": {
            "perspective": False,
            "distance": round(4.0 * extent_m + 8.0, 3),
            "phi": 0,
            "thetaOffset": 0,
            "target": [round(x_m, 3), round(y_m, 3), 0],
            "targetOffset": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.1,
            "far": 5000,
        },
        "followMode": "follow-none",
        "followTf": WORLD,
        "fixedFrame": WORLD,
        "scene": {"transforms": {"axisScale": 0.3, "showLabel": False}},
        "transforms": {},
        "topics": {VIEW_TOPICS[view]: {"visible": True} for view in SCENES},
        "layers": {
            "grid": {
                "layerId": "foxglove.Grid",
                "instanceId": "grid",
                "label": "Grid of 1 m",
                "visible": True,
                "frameLocked": True,
                "frameId": WORLD,
                "size": 50,
                "divisions": 50,
                "lineWidth": 1,
                "color": "#7f7f7f40",
                "position": [0, 0, 0],
                "rotation": [0, 0, 0],
                "order": 1,
            }
        },
        **dict.fromkeys(_TITLES, "Plane"),
    }


def _errors(scenario: Scenario, title: str, signals: Sequence[str]) -> dict[str, Any]:
    """A plot of signals of controllers."""
    series = []
    for number, robot in enumerate(scenario.names[:MOST_ROBOTS]):
        for signal in signals:
            path = f"{topic(robot, Kind.CONTROLLER)}.{signal.lower()}"
            series.append(_series(path, f"{robot} {signal}", robot_style(number).colour))
    return _plot(title, series)


def _differences(scenario: Scenario) -> dict[str, Any]:
    spread, difference = FLEET_SIGNALS
    fleet = VIEW_TOPICS[View.FLEET]
    series = [_series(f"{fleet}.{spread.name}", spread.name, "#7d7d7d")]
    for number, robot in enumerate(scenario.names):
        path = f"{fleet}.{difference.name}[{number}]"
        series.append(_series(path, f"{robot} s − mean", robot_style(number).colour))
    return _plot(f"Differences of path variables [{difference.unit}]", series)


def _series(path: str, label: str, colour: str) -> dict[str, Any]:
    return {
        "value": path,
        "label": label,
        "color": colour,
        "enabled": True,
        "showLine": True,
        "lineSize": 1.2,
        "timestampMethod": "receiveTime",
    }


def _plot(title: str, series: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "paths": list(series),
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": False,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
        **dict.fromkeys(_TITLES, title),
    }
