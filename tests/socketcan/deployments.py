"""Robots on SocketCAN interfaces, and what runs there in a slow guest."""

from collections.abc import Mapping
from pathlib import Path

SLOW_GUEST = (
    # One emulated processor stands still for a tenth of a second now and then.
    *("--set", "drive.watchdog_s=1.0"),
    *("--set", "host.encoder_age_limit_s=0.5"),
    *("--set", "host.heartbeat_age_limit_s=1.0"),
    *("--set", "host.pose_age_limit_s=1.0"),
    *("--set", "clock.countdown_s=1.0"),
    *("--set", "clock.tick_deadline_s=10.0"),
    *("--set", "clock.share_period_s=0.05"),
    *("--set", "clock.localisation_period_s=0.05"),
)


def on_socketcan(folder: Path, channels: Mapping[str, str]) -> Path:
    """A deployment file that puts the buses of these robots on these interfaces.

    "can0 can1": the plant on can0 and the controller on can1, two nodes of one wire.
    """
    lines = ["schema = 1"]
    for robot, channel in channels.items():
        plant, _, host = channel.rpartition(" ")
        lines += [f"[robot.{robot}]", "emulated = true"]
        lines.append(f'bus = {{ interface = "socketcan", channel = "{host}" }}')
        if plant:
            lines.append(f'plant_bus = {{ interface = "socketcan", channel = "{plant}" }}')
    path = folder / "deployment.toml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path
