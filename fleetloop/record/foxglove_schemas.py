"""Schemas that viewers know, as ros2msg texts: Foxglove's, and those of ROS that these refer to.

`foxglove_msgs/*.msg` are the files of foxglove-sdk's `schemas/ros2`, verbatim (MIT, their `LICENSE`
is beside them).
"""

import re
from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parent / "foxglove_msgs"
_RULE = "=" * 80
_FIELD = re.compile(r"^([a-z_]+/[A-Za-z0-9]+)(?:\[\])? ", re.MULTILINE)
_ROS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
}


@cache
def schema_text(name: str) -> str:
    """A schema, such as "foxglove_msgs/Log", followed by all that it refers to, each once."""
    parts, wanted = {name: _text(name)}, [name]
    while wanted:
        for other in _FIELD.findall(parts[wanted.pop(0)]):
            if other not in parts:
                parts[other] = _text(other)
                wanted.append(other)
    rest = (f"{_RULE}\nMSG: {other}\n{text}" for other, text in list(parts.items())[1:])
    return "".join((parts[name], *rest))


def _text(name: str) -> str:
    package, _, kind = name.partition("/")
    if package == "foxglove_msgs":
        return (_FOLDER / f"{kind}.msg").read_text(encoding="utf-8")
    return _ROS[name]
