"""Traffic read from BLF files: python-can's own, ones that were cut, and those of a run."""

from pathlib import Path

import can
import numpy as np
import pytest

from configs.loading import load
from configs.scenario import Scenario
from fleetloop.launch.run import RunOptions, run_scenario
from fleetloop.record.blf_reader import read_frames
from fleetloop.results.known import Known
from fleetloop.results.run_folder import read_record
from fleetloop.results.sections import sections
from fleetloop.results.summary import RunStats, summarise
from fleetloop.results.traffic import traffic_of
from fleetloop.results.view import View

SHORT = (
    *("until_s=0.6", "expect=[]", "drive.iq_period_s=0.01", "drive.temperature_period_s=0.02"),
    *("drive.bus_voltage_period_s=0.02", "host.torque_limit_wheel_N_m=0.3"),
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run") / "a"
    options = RunOptions(
        in_process=True, out=out, overrides=SHORT, figures=False, as_json=True, force=True
    )
    run_scenario("realistic", options)
    return out


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load("realistic", SHORT)


def test_what_the_reader_gives_is_what_python_can_reads(run: Path) -> None:
    path = run / "can" / "r1.blf"
    theirs = [*can.BLFReader(path)]
    ours = read_frames(path)
    assert len(ours) == len(theirs) > 500
    for row, message in zip(ours, theirs, strict=True):
        assert row["id"] == message.arbitration_id
        assert bytes(row["data"][: row["length"]]) == bytes(message.data)
        assert (row["time"] - ours["time"][0]) * 1e-9 == pytest.approx(
            message.timestamp - theirs[0].timestamp, abs=2e-6
        )


def test_a_cut_file_is_read_as_far_as_it_goes_and_another_file_is_refused(
    run: Path, tmp_path: Path
) -> None:
    whole = run / "can" / "r1.blf"
    cut = tmp_path / "cut.blf"
    cut.write_bytes(whole.read_bytes()[:-50])
    assert len(read_frames(cut)) < len(read_frames(whole))
    cut.write_text("not a log")
    with pytest.raises(ValueError, match="no BLF file"):
        read_frames(cut)


def test_load_and_response_times_are_those_of_what_was_sent(run: Path, scenario: Scenario) -> None:
    first, *others = traffic_of(run, scenario)
    assert (first.bus, len(others)) == ("r1", 3)
    assert first.analysis is not None
    # Two estimates and two torques at 200 Hz of at most 135 and 95 bits, and slower messages.
    periods = {one.can_id: one.period_ns for one in first.analysis.messages}
    assert periods[0x009] == pytest.approx(5_000_000, rel=0.01)
    assert periods[0x00E] == pytest.approx(5_000_000, rel=0.01)  # after the frames before it
    assert periods[0x014] == pytest.approx(10_000_000, rel=0.01)
    driving = first.load[first.t_s > 0.1]
    assert float(np.mean(driving)) == pytest.approx(first.analysis.mean_load, rel=0.05)
    assert first.t_s[-1] == pytest.approx(0.6, abs=0.01)  # scenario time: the countdown is before 0
    assert first.slowest.startswith("0x02E ")  # the left drive's torque, last of the fast ones
    assert first.slowest.endswith("ms of its 5 ms")


def test_drives_say_currents_temperatures_and_voltages(run: Path, scenario: Scenario) -> None:
    said = {(one.node, one.name): one for one in traffic_of(run, scenario)[0].measured}
    assert {node for node, _ in said} == {0, 1}
    supply = said[0, "Bus_Voltage"]
    assert supply.unit == "V"
    assert supply.values == pytest.approx(scenario.supply.voltage_V, abs=1.0)
    assert said[0, "FET_Temperature"].values.min() > 15.0
    assert np.abs(said[1, "Iq_Measured"].values).max() > 0.01


def test_a_page_has_them_and_the_tightest_limit_of_torques(run: Path, scenario: Scenario) -> None:
    record = read_record(run, partial=False)
    known = Known(record, scenario, summarise(record, scenario, RunStats("lockstep")))
    shown = {one.key: one for one in sections(View(*known, traffic_of(run, scenario)))}
    assert [line.label for line in shown["buses"].panels[0].lines] == ["r1", "r2", "r3", "r4"]
    assert "r1: 0x0" in shown["buses"].note
    titles = [panel.title for panel in shown["drives"].panels]
    assert "r2: Motor Temperature [°C]" in titles
    assert [line.label for line in shown["drives"].panels[0].lines] == ["right", "left"]
    levels = [bound.level for bound in shown["torques"].panels[0].bounds]
    assert levels == [0.3, -0.3]
    assert "host.torque_limit_wheel_N_m" in shown["torques"].panels[0].bounds[0].text


def test_of_a_run_that_recorded_no_bus_there_is_no_traffic(run: Path, scenario: Scenario) -> None:
    assert traffic_of(run / "elsewhere", scenario) == []
