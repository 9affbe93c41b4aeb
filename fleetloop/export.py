"""`fleetloop export`: a run as one table, a row per tick and robot.

Pose and speeds are the plant's truth (heading not wrapped); the rest is what the controller used
and commanded. Ticks that only one of both has (a run that was cut) are left out.
"""

from pathlib import Path

import numpy as np

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.record.reader import Record
from fleetloop.run_folder import record_of

PLANT_COLUMNS = ("x_m", "y_m", "theta_rad", "v_m_s", "omega_rad_s")
CONTROLLER_COLUMNS = {
    "s": "s",
    "s_dot": "s_dot",
    "v_r_hat": "v_r_hat",
    "x_e_m": "x_e_m",
    "y_e_m": "y_e_m",
    "theta_e_rad": "theta_e_rad",
    "tau_right_N_m": "tau_right_N_m",
    "tau_left_N_m": "tau_left_N_m",
}
COLUMNS = ("t_s", "robot", *PLANT_COLUMNS, *CONTROLLER_COLUMNS)


def table(record: Record) -> dict[str, np.ndarray]:
    """The columns, rows in order of tick, then robot."""
    ticks = min(
        len(rows) for source in (record.plant, record.controller) for rows in source.values()
    )
    robots = record.robots
    plant = np.stack([record.plant[robot][:ticks] for robot in robots], axis=1)
    controller = np.stack([record.controller[robot][:ticks] for robot in robots], axis=1)
    columns = {"t_s": plant["t_s"], "robot": np.tile(np.array(robots), (ticks, 1))}
    columns |= {name: plant[name] for name in PLANT_COLUMNS}
    columns |= {name: controller[signal] for name, signal in CONTROLLER_COLUMNS.items()}
    return {name: columns[name].ravel() for name in COLUMNS}


def export(run: Path, target: Path) -> None:
    """Write the table of a run to a .csv or .npz file.

    Raises:
        ScenarioError: no record there, or another ending.
        InfrastructureError: the file can't be written.
    """
    if target.suffix not in (".csv", ".npz"):
        raise ScenarioError(f"{target}: the ending must be .csv or .npz")
    columns = table(Record.open(record_of(run)))
    try:
        if target.suffix == ".npz":
            with target.open("wb") as stream:
                np.savez(stream, allow_pickle=False, **columns)
        else:
            _write_csv(target, columns)
    except OSError as error:
        raise InfrastructureError(f"can't write {target}: {error.strerror}") from error


def _write_csv(target: Path, columns: dict[str, np.ndarray]) -> None:
    texts = [
        values if name == "robot" else map(repr, values.tolist())
        for name, values in columns.items()
    ]
    with target.open("w", encoding="ascii", newline="") as stream:
        stream.write(",".join(columns) + "\n")
        stream.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))
