"""What the kernel says that it lacks: all that stands in no list of it."""

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import pytest

from configs.loading import folder_of, load, read, shipped
from configs.overrides import Override
from configs.scenario import Scenario
from configs.variants import Variants
from fleetloop.sweep.kernel import coverage
from fleetloop.sweep.kernel.coverage import lacks

NOT_COVERED = {
    "bit timing of buses": ['bus.timing="wire"'],
    "drives with limits or motors of their own": ['drive.preset="limited"'],
    "real time": ['clock.mode="realtime"'],
    "an emulated edge from the leader": [
        "network.edge=[{edges=['leader -> r1'],loss={kind='bernoulli',probability=0.5}}]"
    ],
    "an emulated edge from the localisation": [
        "network.edge=[{edges=['localisation -> *'],loss={kind='bernoulli',probability=0.5}}]"
    ],
    "losses by distance": ["network.default.distance={range_m=3.0}"],
    "robots that join later": ["robot.r2.joins_at_s=1.0"],
    "robots that leave": ["robot.r4.leaves_at_s=1.0"],
    "the law fixed_dsc": ['robot.r2.control.law="fixed_dsc"'],
    'coordination.compensation = "both"': ['coordination.compensation="both"'],
    "a check of poses": ["host.pose_mismatch_limit_m=0.5"],
    "a check of encoders": ["host.encoder_mismatch_limit_wheel_rad=0.5"],
    "a dry run": ["host.dry_run=true"],
    "faults": ["fault=[{kind='torque_stuck',robots=['r1'],at_s=1.0}]"],
    "the key torques_period_s of OdriveSection": ["drive.torques_period_s=0.01"],
}


@pytest.mark.parametrize("reason", NOT_COVERED)
def test_what_is_not_covered_is_named(reason: str) -> None:
    assert lacks(load("paper", NOT_COVERED[reason])) == reason


@pytest.mark.parametrize("reason", NOT_COVERED)
def test_it_is_named_in_a_variant_of_what_is_covered(reason: str) -> None:
    file, text = read("paper")
    base = load("paper")
    variants = Variants(base, tomllib.loads(text), [], folder_of(file))
    overrides = [Override.from_set(one) for one in NOT_COVERED[reason]]
    variant = variants.scenario("case 1", [one for one in overrides if isinstance(one, Override)])
    assert lacks(base) == ""
    assert lacks(variant) == reason
    assert lacks(variants.scenario("case 2", [Override("k4", "control.k4", 2.0)])) == ""
    assert lacks(variant) == reason


def test_every_shipped_scenario_is_covered_or_has_a_reason() -> None:
    covered = {name for name in shipped() if not lacks(load(name))}
    assert {"paper", "paper_ring", "paper_star", "paper_tree", "paper_extra"} <= covered
    assert {"delay_ring", "lossy_chain", "switching", "rotating_counterexample"} <= covered
    assert not {"realistic", "realtime_100hz", "paper_backstepping"} & covered


def test_a_key_that_the_kernel_does_not_know_must_have_its_default(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # As if `q` had been added to scenarios after the kernel was written.
    kind = type(load("paper").coordination)
    known: Mapping[type, Mapping[str, Any]] = coverage._KEYS
    older = {key: reason for key, reason in known[kind].items() if key != "q"}
    monkeypatch.setattr(coverage, "_KEYS", {**known, kind: older})
    coverage._looks_of.cache_clear()
    try:
        assert lacks(load("paper", ["coordination.q=1.0"])) == ""
        assert lacks(load("paper", ["coordination.q=1.5"])) == "the key q of Coordination"
    finally:
        coverage._looks_of.cache_clear()


def test_a_section_that_the_kernel_does_not_know_must_be_its_default(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    older = {key: reason for key, reason in coverage._SECTIONS.items() if key != "supply"}
    monkeypatch.setattr(coverage, "_SECTIONS", older)
    assert lacks(load("paper")) == ""
    assert lacks(load("paper", ["supply.voltage_V=23.0"])) == "section [supply]"


def test_the_lists_have_no_key_that_scenarios_do_not_have() -> None:
    for kind, keys in coverage._KEYS.items():
        assert set(keys) <= {field.name for field in fields(kind)}, kind
    assert set(coverage._SECTIONS) <= set(Scenario.model_fields)
    drive = load("paper").drive_choice.parameters
    assert set(coverage._DRIVE) <= {field.name for field in fields(drive)}


def test_without_the_compiler_nothing_is_covered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coverage, "_has_compiler", lambda: False)
    assert lacks(load("paper")).startswith("numba, which isn't installed")
