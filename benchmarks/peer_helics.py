"""HELICS: a broker, a plant federate and N controller federates; prints the seconds of a run."""

import multiprocessing
import sys
import time

import helics as h


def federate(name: str, core_init: str) -> object:
    """A value federate with a period of 1."""
    info = h.helicsCreateFederateInfo()
    h.helicsFederateInfoSetCoreTypeFromString(info, "tcp")
    h.helicsFederateInfoSetCoreInitString(info, core_init)
    h.helicsFederateInfoSetTimeProperty(info, h.helics_property_time_period, 1.0)
    return h.helicsCreateValueFederate(name, info)


def controller(k: int, rounds: int) -> None:
    """Receive 4 doubles, answer 2, every step."""
    fed = federate(f"c{k}", "--federates=1")
    out = h.helicsFederateRegisterGlobalPublication(fed, f"back{k}", h.HELICS_DATA_TYPE_VECTOR, "")
    heard = h.helicsFederateRegisterSubscription(fed, f"out{k}", "")
    h.helicsFederateEnterExecutingMode(fed)
    for tick in range(1, rounds + 1):
        h.helicsPublicationPublishVector(out, [1.0, 2.0])
        h.helicsFederateRequestTime(fed, float(tick))
        h.helicsInputGetVector(heard)
    h.helicsFederateDisconnect(fed)


def plant(n: int, rounds: int, result: object) -> None:
    """Send 4 doubles to each, take 2 of each, every step."""
    fed = federate("plant", "--federates=1")
    outs = [
        h.helicsFederateRegisterGlobalPublication(fed, f"out{k}", h.HELICS_DATA_TYPE_VECTOR, "")
        for k in range(n)
    ]
    heard = [h.helicsFederateRegisterSubscription(fed, f"back{k}", "") for k in range(n)]
    h.helicsFederateEnterExecutingMode(fed)
    began = time.perf_counter()
    for tick in range(1, rounds + 1):
        for out in outs:
            h.helicsPublicationPublishVector(out, [1.0, 2.0, 3.0, 4.0])
        h.helicsFederateRequestTime(fed, float(tick))
        for back in heard:
            h.helicsInputGetVector(back)
    result.put(time.perf_counter() - began)
    h.helicsFederateDisconnect(fed)


def main() -> None:
    """Run with `n` controllers for `rounds` steps."""
    n, rounds = int(sys.argv[1]), int(sys.argv[2])
    broker = h.helicsCreateBroker("tcp", "", f"--federates={n + 1}")
    spawn = multiprocessing.get_context("spawn")
    result = spawn.Queue()
    parts = [spawn.Process(target=controller, args=(k, rounds)) for k in range(n)]
    parts.append(spawn.Process(target=plant, args=(n, rounds, result)))
    for part in parts:
        part.start()
    seconds = result.get(timeout=200)
    for part in parts:
        part.join(30)
    h.helicsBrokerDisconnect(broker)
    print(seconds)


if __name__ == "__main__":
    main()
