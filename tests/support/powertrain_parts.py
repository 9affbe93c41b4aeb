"""Models with the defaults of a scenario, for the tests of motor, encoder and supply."""

from dataclasses import replace
from random import Random
from typing import Any

from configs.brief import MotorModel, PowertrainModel
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief
from plant.encoder import Encoder
from plant.motor import Motor
from plant.supply import Supply

INERTIA = 6e-3  # kg m²


def _defaults() -> PowertrainModel:
    scenario = load("two_robots", ("drive.preset='realistic'",))
    return plant_brief(scenario, network=NetworkLink("t", "", "", "")).robots[0].powertrain


MODEL = _defaults()


def motor_model(**changes: Any) -> MotorModel:
    return replace(MODEL.motor, **changes)


def motor(seed: int = 1, supply: Supply | None = None, **changes: Any) -> Motor:
    source = supply or Supply(MODEL.supply)
    return Motor(motor_model(**changes), INERTIA, source, Random(seed))


def encoder(seed: int = 1, **changes: Any) -> Encoder:
    return Encoder(replace(MODEL.encoder, **changes), Random(seed))


def supply(**changes: Any) -> Supply:
    return Supply(replace(MODEL.supply, **changes))
