"""Robots on SocketCAN interfaces, and what runs there in a slow guest."""

from collections.abc import Mapping
from pathlib import Path

SLOW_GUEST = (
    # One emulated processor stands still for a tenth of a second now and then.
    *("--set", "drive.watchdog_s=1.0"),
    *("--set", "clock.countdown_s=1.0"),
    *("--set", "clock.tick_deadline_s=10.0"),
    *("--set", "clock.share_period_s=0.05"),
    *("--set", "clock.localisation_period_s=0.05"),
)


def on_socketcan(folder: Path, channels: Mapping[str, str]) -> Path:
    """A deployment file that puts the buses of these robots on these interfaces."""
    lines = ["schema = 1"]
    for robot, channel in channels.items():
        lines += [
            f"[robot.{robot}]",
            "emulated = true",
            f'bus = {{ interface = "socketcan", channel = "{channel}" }}',
        ]
    path = folder / "deployment.toml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path
