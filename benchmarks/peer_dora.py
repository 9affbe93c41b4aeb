"""dora-rs: a plant node and N controller nodes under `dora run`; prints the seconds of a run.

`dora run` is coordinator and daemon in one process, for this dataflow only, and ends with the last
node; a node whose daemon is gone ends too. No node gets its first message before all are ready.
"""

import json
import shlex
import subprocess
import sys
import sysconfig
import tempfile
import time
from pathlib import Path

import pyarrow as pa
from dora import Node

SILENCE_S = 30.0
LIMIT_S = 250.0


def take(node: Node) -> list[float]:
    """The next message's numbers; the run has failed if anything else comes."""
    event = node.next(timeout=SILENCE_S)
    if event is None or event["type"] != "INPUT":
        sys.exit(f"the plant expected a message, found {event}")
    return event["value"].to_pylist()


def controller() -> None:
    """Receive 4 doubles, answer 2, until the plant has ended."""
    node = Node()
    while (event := node.next(timeout=SILENCE_S)) is not None and event["type"] == "INPUT":
        event["value"].to_pylist()
        node.send_output("back", pa.array([1.0, 2.0], pa.float64()))


def plant(n: int, rounds: int, result: Path) -> None:
    """Send 4 doubles to each, wait for 2 of each, every round."""
    node = Node()
    began = time.perf_counter()
    for _ in range(rounds):
        for k in range(n):
            node.send_output(f"out{k}", pa.array([1.0, 2.0, 3.0, 4.0], pa.float64()))
        for _ in range(n):
            take(node)
    result.write_text(str(time.perf_counter() - began))


def dataflow(n: int, *plant_arguments: str) -> dict[str, object]:
    """Who hears whom, and how each is started."""

    def node(name: str, inputs: dict[str, str], outputs: list[str], *arguments: str) -> dict:
        args = shlex.join([str(Path(__file__).resolve()), *arguments])
        start = {"id": name, "path": sys.executable, "args": args}
        return start | {"inputs": inputs, "outputs": outputs}

    backs = {f"back{k}": f"c{k}/back" for k in range(n)}
    nodes = [node("plant", backs, [f"out{k}" for k in range(n)], "plant", *plant_arguments)]
    nodes += [node(f"c{k}", {"heard": f"plant/out{k}"}, ["back"], "controller") for k in range(n)]
    return {"nodes": nodes}


def run(n: int, rounds: int) -> float:
    """The seconds that the plant's rounds took."""
    with tempfile.TemporaryDirectory() as folder:
        flow, result = Path(folder) / "flow.yml", Path(folder) / "seconds"
        flow.write_text(json.dumps(dataflow(n, str(n), str(rounds), str(result))))
        done = subprocess.run(
            [str(Path(sysconfig.get_path("scripts")) / "dora"), "run", str(flow)],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
        )
        if done.returncode or not result.exists():
            sys.exit(f"dora run ended with {done.returncode}: {done.stderr}{done.stdout}")
        return float(result.read_text())


def main() -> None:
    """Run with `n` controllers for `rounds` rounds, or be one of the nodes."""
    match sys.argv[1:]:
        case ["controller"]:
            controller()
        case ["plant", n, rounds, result]:
            plant(int(n), int(rounds), Path(result))
        case [n, rounds]:
            print(run(int(n), int(rounds)))
        case _:
            sys.exit(f"usage: {sys.argv[0]} CONTROLLERS ROUNDS")


if __name__ == "__main__":
    main()
