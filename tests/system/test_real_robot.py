"""A robot that the run doesn't emulate: drives on its own bus, its pose from a localisation system.

The stand-in for the hardware is a plant of its own, in another process, on a bus that python-can
carries; to the run it is as real as any.
"""

import secrets
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.addresses import free_port, multicast_bus, multicast_goes_nowhere
from support.processes import Run
from support.snippets import snippets

from fleetloop.record.reader import Record
from fleetloop.testing import EmulatedPlant

pytestmark = [
    pytest.mark.system,
    pytest.mark.wall_clock,
    pytest.mark.skipif(multicast_goes_nowhere(), reason="no route for multicast here"),
]
PERIOD_NS = 10_000_000


class Localisation:
    """A motion-capture system's program, as the page prints it, until told to stop."""

    def __init__(self, endpoint: str, password: str, plant: EmulatedPlant) -> None:
        self._stop = threading.Event()
        self._plant = plant
        (printed,) = (s.text for s in snippets("python") if "motion_capture()" in s.text)
        names = {
            "endpoint": endpoint,
            "password": password,
            "period_ns": PERIOD_NS,
            "motion_capture": self._poses,
        }
        self._thread = threading.Thread(target=exec, args=(printed.replace('"r1"', '"r2"'), names))
        self._thread.start()

    def _poses(self) -> Iterator[tuple[float, float, float]]:
        while not self._stop.wait(0.01):
            state = self._plant.poses()["r2"]
            yield state.x_m, state.y_m, state.theta_rad

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(10.0)


def test_a_real_robot_and_an_emulated_one_keep_their_formation(tmp_path: Path) -> None:
    emulated, bus = tmp_path / "hardware.toml", multicast_bus()
    emulated.write_text(f"[robot.r2]\nemulated = true\n{bus}\n")
    password, port = secrets.token_hex(8), free_port()
    (tmp_path / "users").write_text(f"localisation:{password}\n")
    (tmp_path / "users").chmod(0o600)
    where = tmp_path / "where.toml"
    where.write_text(
        f'[network]\nendpoint = "tcp/127.0.0.1:{port}"\nusers = "users"\nrun = "lab"\n'
        f"[robot.r2]\n{bus}\n"
    )
    with EmulatedPlant("two_robots_100hz", robots=["r2"], deployment=emulated) as hardware:
        run = Run(tmp_path / "run", "two_robots_100hz", "--deployment", str(where))
        localisation = Localisation(f"tcp/127.0.0.1:{port}", password, hardware)
        try:
            status, out = run.end()
        finally:
            localisation.stop()
            run.kill()
        after = hardware.poses()["r2"]
    assert status == 0, out
    record = Record.open(tmp_path / "run" / "record.mcap")
    truth = record.plant["r2"]
    assert truth["tick"].tolist() == list(range(1000))
    assert np.isnan(truth["motor_right_wheel_N_m"]).all()
    # What was recorded of it is where it was, and it has been left without torque: from then on it
    # coasts by v m̄_1 / d̄_11 = 0.6 · 0.0077 / 0.02 = 0.23 m at most.
    assert np.hypot(truth["x_m"][-1] - after.x_m, truth["y_m"][-1] - after.y_m) < 0.25
    assert after.torque_right_wheel_N_m == 0.0
    assert run.summary()["verdict"] == "held"
