"""Faults of a scenario, over processes: the same record as in one process, bit for bit."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.processes import completed

from fleetloop.results.run_folder import read_record

pytestmark = pytest.mark.system

FAULTS = """fault=[
  {kind="push", at_s=0.2, for_s=0.1, robots=["r1"], force_body_N=8.0, torque_body_N_m=0.1},
  {kind="link_partition", at_s=0.2, for_s=0.3, edges=["r1 -> r2"]},
  {kind="link_delay", at_s=0.3, for_s=0.3, edges=["leader -> r1"], delay_s=0.05},
  {kind="link_loss", at_s=0.6, edges=["* -> *"], probability=0.4},
  {kind="localisation_outage", at_s=0.1, for_s=0.2, robots=["r2"]}]"""


def test_faults_act_at_the_same_ticks_over_processes(tmp_path: Path) -> None:
    args = ("two_robots", "--duration", "1.0", "--allow-unchecked", "--set", FAULTS)
    assert completed(tmp_path / "a", *args)[0] == 0
    assert completed(tmp_path / "b", *args, "--in-process")[0] == 0
    records = [(tmp_path / name / "record.mcap").read_bytes() for name in "ab"]
    assert records[0] == records[1]
    summaries = [json.loads((tmp_path / name / "summary.json").read_text()) for name in "ab"]
    assert summaries[0]["events"] == summaries[1]["events"]
    assert summaries[0]["faults"] == summaries[1]["faults"]
    changes = [it for it in summaries[0]["events"] if it["kind"].startswith("fault")]
    assert [(it["tick"], it["source"], it["text"]) for it in changes[:3]] == [
        (50, "r2", "localisation_outage"),
        (100, "r1", "push"),
        (100, "r2", "link_partition on r1 -> r2"),
    ]
    rows = read_record(tmp_path / "a", partial=False).controller["r2"]
    cut = (rows["t_s"] > 0.2) & (rows["t_s"] < 0.5)
    assert rows["age_of_r1_s"][cut].max() == pytest.approx(0.298 + 0.02, abs=0.02)
    assert np.nanmax(rows["age_of_localisation_s"][rows["t_s"] < 0.3]) > 0.19
