"""Shaft speeds and encoder jitter, against closed forms and the emulated encoder itself."""

from math import pi
from random import Random

import numpy as np
import pytest

from configs.loading import load
from configs.powertrain import Encoder as Model
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding
from fleetloop.check.wheels import encoder_jitter_shaft_rev_s
from plant.encoder import Encoder

LINE = "path={kind='line'}", "coordination.v_hat_0=0.6"


def found(title: str, *overrides: str) -> Finding:
    scenario = load("realistic", (*LINE, *overrides))
    return next(f for f in examine("realistic", scenario) if f.title.startswith(title))


@pytest.mark.parametrize(("gear", "level"), [(1.0, "ok"), (3.5, "warning"), (5.0, "error")])
def test_a_shaft_turns_with_the_gear_against_the_velocity_limit(gear: float, level: str) -> None:
    finding = found("shaft speed", f"mounting.gear_ratio={gear}")
    speed = gear * 0.6 / 0.04 / (2.0 * pi)
    assert (finding.level, finding.value.split()[0]) == (level, f"{speed:.3g}")


@pytest.mark.parametrize(("bandwidth", "counts"), [(1000.0, 8192), (1000.0, 1024), (300.0, 1024)])
def test_the_largest_jitter_of_an_emulated_encoder_is_of_the_order(
    bandwidth: float, counts: int
) -> None:
    model = Model(counts_per_shaft_rev=counts, pll_bandwidth_rad_s=bandwidth)
    encoder, largest = Encoder(model, Random(1)), 0.0
    for speed in np.geomspace(0.01, 8.0, 16):  # counts beat with the loop, more or less
        encoder.reset(0.0, 2.0 * pi * speed)
        rows = [encoder.step(2.0 * pi * speed * n * 1e-3, 1e-3)[1] for n in range(1, 800)]
        largest = max(largest, float(np.std(rows[200:])))
    assert 0.5 < largest / encoder_jitter_shaft_rev_s(model) < 5.0


def test_jitter_beyond_a_quarter_of_the_need_is_warned_of() -> None:
    assert found("torque jitter").level == "ok"
    finding = found("torque jitter", "encoder.counts_per_shaft_rev=256")
    assert (finding.level, finding.key) == ("warning", "encoder.counts_per_shaft_rev")
