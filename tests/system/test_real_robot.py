"""A robot that the run doesn't emulate: drives on its own bus, its pose from a localisation system.

The stand-in for the hardware is a plant of its own, in another process, on a bus that python-can
carries; to the run it is as real as any.
"""

import secrets
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from system.processes import Run
from system.test_elsewhere import free_port, multicast_goes_nowhere

from bridge import keys
from bridge.clock import monotonic_of
from bridge.messages import Go, PoseFix
from bridge.zenoh_link import open_client
from configs.brief import NetworkLink
from fleetloop.record.reader import Record
from fleetloop.testing import EmulatedPlant

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(multicast_goes_nowhere(), reason="no route for multicast here"),
]
BUS = 'bus = { interface = "udp_multicast", channel = "239.74.163.9", port = 43116, hop_limit = 0 }'
PERIOD_NS = 10_000_000


class Localisation:
    """What a motion-capture system's program does: says a robot's pose until told to stop."""

    def __init__(self, network: NetworkLink, robot: str, plant: EmulatedPlant) -> None:
        self._stop = threading.Event()
        self._args = network, robot, plant
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        network, robot, plant = self._args
        with open_client(network, 20.0) as link:
            link.subscribe(keys.go(network.run), "go")
            pose = link.publisher(keys.pose(network.run, robot))
            tick, epoch_ns = -1, None
            while not self._stop.wait(0.01):
                while (arrival := link.receive(0.0)) is not None:
                    go = Go.decode(arrival.payload)
                    epoch_ns = monotonic_of(go.epoch_ns) if go is not None else epoch_ns
                state = plant.poses()[robot]
                if epoch_ns is not None:
                    tick = (time.monotonic_ns() - epoch_ns) // PERIOD_NS
                fix = PoseFix(tick, tick * PERIOD_NS, state.x_m, state.y_m, state.theta_rad)
                pose.put(fix.encode())

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(10.0)


def test_a_real_robot_and_an_emulated_one_keep_their_formation(tmp_path: Path) -> None:
    emulated = tmp_path / "hardware.toml"
    emulated.write_text(f"[robot.r2]\nemulated = true\n{BUS}\n")
    password, port = secrets.token_hex(8), free_port()
    (tmp_path / "users").write_text(f"localisation:{password}\n")
    (tmp_path / "users").chmod(0o600)
    where = tmp_path / "where.toml"
    where.write_text(
        f'[network]\nendpoint = "tcp/127.0.0.1:{port}"\nusers = "users"\nrun = "lab"\n'
        f"[robot.r2]\n{BUS}\n"
    )
    with EmulatedPlant("two_robots_100hz", robots=["r2"], deployment=emulated) as hardware:
        run = Run(tmp_path / "run", "two_robots_100hz", "--deployment", str(where))
        network = NetworkLink("lab", f"tcp/127.0.0.1:{port}", "localisation", password)
        localisation = Localisation(network, "r2", hardware)
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
    assert np.isnan(truth["motor_right_N_m"]).all()
    # What was recorded of it is where it was, and it has been left without torque.
    assert np.hypot(truth["x_m"][-1] - after.x_m, truth["y_m"][-1] - after.y_m) < 0.1
    assert after.torque_right_N_m == 0.0
    assert run.summary()["verdict"] == "held"
