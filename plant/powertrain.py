"""The powertrain between the two drives of a robot and its gears: motors, encoders, one supply.

    demand ─► motor ─torque─► shaft ─angle─► encoder ─► drive
                │ power
              supply ─bus voltage─► both motors

Every source of noise has a generator of its own, seeded by the scenario's seed, the robot and its
place, so none depends on how often another one is asked.
"""

from random import Random

from configs.brief import PowertrainModel
from plant.encoder import Encoder
from plant.motor import Motor
from plant.supply import Supply


class Powertrain:
    """The parts of one robot."""

    __slots__ = ("left_encoder", "left_motor", "right_encoder", "right_motor", "supply")

    def __init__(
        self,
        supply: Supply,
        right_motor: Motor,
        left_motor: Motor,
        right_encoder: Encoder,
        left_encoder: Encoder,
    ) -> None:
        self.supply = supply
        self.right_motor = right_motor
        self.left_motor = left_motor
        self.right_encoder = right_encoder
        self.left_encoder = left_encoder

    def step(
        self,
        demands_shaft_N_m: tuple[float, float],
        speeds_shaft_rad_s: tuple[float, float],
        dt_s: float,
    ) -> tuple[float, float]:
        """(right, left) torque at the shafts [N·m], held over `dt_s`; the supply follows."""
        right = self.right_motor.step(demands_shaft_N_m[0], speeds_shaft_rad_s[0], dt_s)
        left = self.left_motor.step(demands_shaft_N_m[1], speeds_shaft_rad_s[1], dt_s)
        self.supply.step(self.right_motor.power_W, self.left_motor.power_W, dt_s)
        return right, left


def powertrain(model: PowertrainModel, inertia_shaft_kg_m2: float) -> Powertrain:
    """Build the parts; `inertia_shaft_kg_m2` as `plant.motor.Motor` wants it."""
    supply = Supply(model.supply)

    def source(part: str) -> Random:
        return Random(f"{model.seed}/{part}")

    return Powertrain(
        supply,
        Motor(model.motor, inertia_shaft_kg_m2, supply, source("right motor")),
        Motor(model.motor, inertia_shaft_kg_m2, supply, source("left motor")),
        Encoder(model.encoder, source("right encoder")),
        Encoder(model.encoder, source("left encoder")),
    )
