"""`fleetloop network --router-config`: the configuration of a run's router as a file.

A stock `zenohd` of the same version takes it. Beside it is the file of users and passwords that it
names, readable by its owner alone.
"""

import os
from importlib.metadata import version
from pathlib import Path

from bridge.network.router_config import document, router_settings
from configs.connections import LEASE_S
from configs.deployment import load_deployment
from configs.errors import InfrastructureError, ScenarioError
from configs.loading import load
from configs.overrides import Overrides
from configs.resolve import schedule
from fleetloop.launch import placement
from fleetloop.launch.process_run import UNREAD_SHARE
from fleetloop.terminal import say


def write_router_config(
    source: str, deployment_file: Path, out: Path, overrides: Overrides
) -> None:
    """Write `out`, and the users that it names beside it.

    Raises:
        ScenarioError: scenario, deployment or credentials are wrong, or the deployment's router is
            the launcher.
        InfrastructureError: a file can't be written.
    """
    scenario = load(source, overrides)
    deployment = load_deployment(deployment_file, scenario)
    network, run = deployment.network, placement.run_name(scenario, deployment)
    if network is None or run is None or not network.external:
        raise ScenarioError(
            f'{deployment_file}: network.router must be "external": else the launcher is the router'
        )
    users = out.with_name(f"{out.name}.users").absolute()
    plan = placement.access_plan(scenario, deployment, run)
    tls = network.tls_of(None)
    settings = router_settings(
        plan,
        [network.listen or network.endpoint],
        users,
        None if tls is None else tls.absolute(),
        lease_s=LEASE_S,
        unread_s=UNREAD_SHARE * schedule(scenario).tick_deadline_s,
    )
    title = (
        f"Router of run {run!r} for Zenoh {version('eclipse-zenoh')}: zenohd -c {out.name}\n"
        f"// Made by `fleetloop network --router-config`: make it again after every change."
    )
    _write(users, plan.dictionary(), 0o600)
    _write(out, document(settings, title), 0o644)
    say(f"wrote {out}, and {users.name} with what it is told of {len(plan.rights)} identities")


def _write(file: Path, text: str, mode: int) -> None:
    try:
        file.unlink(missing_ok=True)  # it may be readable by others
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "w") as stream:
            stream.write(text)
    except OSError as error:
        raise InfrastructureError(f"can't write {file}: {error.strerror}") from error
