"""The command line: `fleetloop VERB ...`. A verb's arguments are in `app.py` of its room.

Exit status: 0 held, 1 an expectation failed or was not reached, two runs differ or a record is cut,
2 usage or scenario, 3 infrastructure (named), 5 nothing to test, 130 interrupted
(`configs.errors.ExitStatus`).
"""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from configs.errors import ExitStatus, FleetloopError
from fleetloop import numbers
from fleetloop.campaign.app import campaign
from fleetloop.can.app import app as can_app
from fleetloop.certificates.app import app as certs_app
from fleetloop.check.app import check
from fleetloop.compare.app import compare
from fleetloop.doctor.app import doctor
from fleetloop.fault.app import app as fault_app
from fleetloop.graph.app import graph
from fleetloop.launch.app import agent, network, plant, run
from fleetloop.live.app import live
from fleetloop.options import VersionOption
from fleetloop.replay.app import replay
from fleetloop.results.app import diff, export, report
from fleetloop.runs.app import ps, stop
from fleetloop.steer.app import app as steer_app
from fleetloop.suite.app import test
from fleetloop.sweep.app import app as sweep_app
from fleetloop.tune.app import tune

app = typer.Typer(
    name="fleetloop",
    cls=numbers.OurWords,
    help="Run cooperating differential-drive robots in emulation: one controller process per robot,"
    " Zenoh between them, a python-can bus to emulated drives.",
    epilog="Start with: fleetloop run paper",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.add_typer(can_app, name="can")
app.add_typer(certs_app, name="certs")
app.add_typer(fault_app, name="fault")
app.add_typer(steer_app, name="steer")
app.add_typer(sweep_app, name="sweep")


def init(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.toml", help="The scenario file to write.")
    ] = Path("scenario.toml"),
) -> None:
    """Write a commented starter scenario."""
    from fleetloop.init import write_starter

    write_starter(file)


for verb in (
    run,
    test,
    agent,
    plant,
    check,
    doctor,
    ps,
    stop,
    compare,
    campaign,
    tune,
    graph,
    network,
    live,
    report,
    export,
    diff,
    replay,
    init,
):
    app.command()(verb)


@app.callback()
def _common(version: VersionOption = False) -> None:
    pass


def main() -> None:
    """Run the command line; an error that a user can cause is one line and an exit status."""
    status: str | int | None = ExitStatus.OK
    try:
        app()
    except SystemExit as ended:
        status = ended.code
    except FleetloopError as error:
        sys.stderr.write(f"fleetloop: {error}\n")
        status = int(error.exit_status)
    link = sys.modules.get("bridge.network.zenoh_link")
    if link is not None and link.ZenohLink.stuck:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status if isinstance(status, int) else ExitStatus.FAILED)
    sys.exit(status)
