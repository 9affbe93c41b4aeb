"""mosaik: a plant and N controllers as subprocess simulators; prints the seconds of a run.

The plant counts from its first step until the exchange after its last one is over: mosaik's own run
includes the end of all simulators.
"""

import sys
import time

import mosaik
import mosaik_api_v3

META = {
    "api_version": "3.0",
    "type": "time-based",
    "models": {"Part": {"public": True, "params": [], "attrs": ["out", "back", "heard"]}},
}


class Part(mosaik_api_v3.Simulator):
    """Says its values at every step and takes what it is given."""

    def __init__(self) -> None:
        super().__init__(META)
        self.eid = ""
        self.rounds = -1
        self.began = 0.0

    def init(self, sid: str, time_resolution: float = 1.0, rounds: int = -1) -> dict:
        self.eid, self.rounds = f"{sid}-part", rounds
        return self.meta

    def create(self, num: int, model: str, **_: object) -> list[dict]:
        return [{"eid": self.eid, "type": model}]

    def step(self, now: int, inputs: dict, max_advance: int) -> int:
        if now == 0:
            self.began = time.perf_counter()
        elif now == self.rounds:
            print(time.perf_counter() - self.began, flush=True)
        return now + 1

    def get_data(self, outputs: dict) -> dict:
        values = {"out": [1.0, 2.0, 3.0, 4.0], "back": [1.0, 2.0]}
        return {eid: {name: values[name] for name in names} for eid, names in outputs.items()}


def main() -> None:
    """Run with `n` controllers for `rounds` steps, or serve as one simulator."""
    if len(sys.argv) == 2 or not sys.argv[1].isdigit():
        mosaik_api_v3.start_simulation(Part())
        return
    n, rounds = int(sys.argv[1]), int(sys.argv[2])
    command = f"{sys.executable} {__file__} %(addr)s"
    world = mosaik.World({"Part": {"cmd": command}})
    plant = world.start("Part", rounds=rounds).Part()
    for _ in range(n):
        part = world.start("Part").Part()
        world.connect(plant, part, ("out", "heard"))
        world.connect(
            part, plant, ("back", "heard"), time_shifted=True, initial_data={"back": [0.0, 0.0]}
        )
    world.run(until=rounds + 1, print_progress=False)


if __name__ == "__main__":
    main()
