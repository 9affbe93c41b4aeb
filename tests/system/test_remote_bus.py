"""A program on another machine opens a robot's bus during a run, over TLS or with a password."""

import asyncio
import subprocess
import sys
from pathlib import Path

import can
import pytest
from odrive_can import ODriveCAN
from support.addresses import free_port
from support.certificates import certificates
from support.processes import Run, running

pytestmark = pytest.mark.system

LISTENER = """
import sys, can
with can.Bus(interface="fleetloop", channel="r1", endpoint=sys.argv[1], user="bench",
             ca="ca.pem", certificate="bench.pem", private_key="bench.key") as bus:
    bus.recv(10.0)
    print("listening", flush=True)
    while True:
        bus.recv(1.0)
"""


def deployment(folder: Path) -> tuple[Path, str]:
    endpoint = f"tls/localhost:{free_port()}"
    file = folder / "where.toml"
    file.write_text(
        f'[network]\nendpoint = "{endpoint}"\n'
        'tls = { ca = "ca.pem", certificate = "router.pem", private_key = "router.key" }\n'
        '[network.guests]\nbench = ["r1"]\n'
    )
    return file, endpoint


def guest(folder: Path, endpoint: str, name: str = "bench", channel: str = "r1") -> can.BusABC:
    return can.Bus(
        interface="fleetloop",
        channel=channel,
        endpoint=endpoint,
        user=name,
        ca=str(folder / "ca.pem"),
        certificate=str(folder / f"{name}.pem"),
        private_key=str(folder / f"{name}.key"),
        connect_timeout=5.0,
    )


def test_a_guest_with_a_certificate_sees_the_bus_asks_and_learns_of_its_end(tmp_path: Path) -> None:
    certificates(tmp_path, ("router", "bench", "stranger"))
    where, endpoint = deployment(tmp_path)
    args = ("two_robots", "--speed", "1", "--deployment", str(where))
    with (
        running(tmp_path / "run", *args, bus_time_s=0.2) as run,
        guest(tmp_path, endpoint) as bus,
    ):
        seen = {bus.recv(5.0).arbitration_id for _ in range(400)}
        assert {0x009, 0x029, 0x00E, 0x02E} <= seen
        ask = can.Message(arbitration_id=0x017, is_remote_frame=True, dlc=8, is_extended_id=False)
        bus.send(ask)
        answer = next(message for message in bus if message.arbitration_id == 0x017)
        assert len(answer.data) == 8
        with pytest.raises(can.CanInitializationError, match="may open r1, not 'r2'"):
            guest(tmp_path, endpoint, channel="r2")
        with pytest.raises(can.CanInitializationError):
            guest(tmp_path, endpoint, "stranger")
        status, out = run.end()
        assert status == 0, out
        with pytest.raises(can.CanOperationError, match="end of the run"):
            while bus.recv(5.0) is not None:
                pass


def test_an_independent_odrive_client_asks_an_axis_from_afar(tmp_path: Path) -> None:
    certificates(tmp_path, ("router", "bench"))
    where, endpoint = deployment(tmp_path)
    args = ("two_robots", "--speed", "1", "--deployment", str(where))
    with (
        running(tmp_path / "run", *args, bus_time_s=0.2),
        guest(tmp_path, endpoint) as bus,
    ):
        # Its DBC knows no torque frame of 4 bytes, as the controller beside it sends them.
        bus.set_filters([{"can_id": node, "can_mask": 0x7FF} for node in (0x021, 0x037)])
        asyncio.run(ask(bus))


async def ask(bus: can.BusABC) -> None:
    """Heartbeat, a request and its answer, twice: node 1 is the left wheel."""
    axis = ODriveCAN(axis_id=1, can_bus=bus)
    async with asyncio.timeout(20.0):
        await axis.start()
        try:
            axis.check_alive()
            axis.check_errors()
            for _ in range(2):
                answer = await axis.get_bus_voltage_current()
                assert answer["Bus_Voltage"] == pytest.approx(24.0)
        finally:
            axis.stop()


def test_a_guest_that_is_killed_harms_nobody(tmp_path: Path) -> None:
    certificates(tmp_path, ("router", "bench"))
    where, endpoint = deployment(tmp_path)
    args = ("two_robots", "--speed", "1", "--deployment", str(where))
    run = Run(tmp_path / "run", *args)
    listener = None
    try:
        run.await_bus_time(0.2)
        listener = subprocess.Popen(
            [sys.executable, "-c", LISTENER, endpoint],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert listener.stdout is not None
        assert listener.stdout.readline() == "listening\n"
        listener.kill()
        status, out = run.end()
        assert status == 0, out
        assert run.summary()["ticks"] == 2000
    finally:
        run.kill()
        if listener is not None:
            listener.kill()
            listener.communicate()
