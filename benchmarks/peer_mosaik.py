"""mosaik: a plant and N controllers as subprocess simulators; prints the seconds of a run."""

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

    def init(self, sid: str, time_resolution: float = 1.0, **_: object) -> dict:
        self.eid = f"{sid}-part"
        return self.meta

    def create(self, num: int, model: str, **_: object) -> list[dict]:
        return [{"eid": self.eid, "type": model}]

    def step(self, now: int, inputs: dict, max_advance: int) -> int:
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
    plant = world.start("Part").Part()
    for _ in range(n):
        part = world.start("Part").Part()
        world.connect(plant, part, ("out", "heard"))
        world.connect(
            part, plant, ("back", "heard"), time_shifted=True, initial_data={"back": [0.0, 0.0]}
        )
    began = time.perf_counter()
    world.run(until=rounds, print_progress=False)
    print(time.perf_counter() - began)


if __name__ == "__main__":
    main()
