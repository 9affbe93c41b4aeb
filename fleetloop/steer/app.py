"""The command line of `fleetloop steer [RUN] VERB ...`: arguments only."""

from typing import Annotated, Any

import typer

from fleetloop.numbers import LONGEST_S, between, finite, speed
from fleetloop.options import ForceOption, JsonOption, verbs_of_run

app = verbs_of_run("A run while it goes on: pause, step, speed, the leader's speed, e-stop, stop.")


@app.command()
def status(ctx: typer.Context, as_json: JsonOption = False) -> None:
    """Show how far a run is, and its processes."""
    from fleetloop.steer.command import print_status

    print_status(ctx.obj, as_json=as_json)


@app.command()
def pause(ctx: typer.Context, force: ForceOption = False, as_json: JsonOption = False) -> None:
    """Let time stand still in all processes at one tick; in lockstep."""
    _ask(ctx, "run.pause", {}, force=force, as_json=as_json)


@app.command()
def resume(ctx: typer.Context, force: ForceOption = False, as_json: JsonOption = False) -> None:
    """Let a paused run go on."""
    _ask(ctx, "run.resume", {}, force=force, as_json=as_json)


@app.command()
def step(
    ctx: typer.Context,
    ticks: Annotated[int, typer.Argument(metavar="N", help="So many ticks.")] = 1,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Let a paused run go on by some ticks."""
    _ask(ctx, "run.step", {"ticks": ticks}, force=force, as_json=as_json)


@app.command("speed")
def speed_(
    ctx: typer.Context,
    factor: Annotated[
        float,
        typer.Argument(
            metavar="X",
            callback=speed,
            help="Multiple of real time; 0: as fast as the machine allows.",
        ),
    ],
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Hold a run to a speed; in lockstep."""
    _ask(ctx, "run.speed", {"factor": factor}, force=force, as_json=as_json)


@app.command("leader-speed")
def leader_speed(
    ctx: typer.Context,
    speed_m_s: Annotated[
        float, typer.Argument(metavar="V", callback=finite, help=r"v_r afterwards \[m/s].")
    ],
    ramp_s: Annotated[
        float,
        typer.Option(
            "--ramp",
            callback=between(0.0, LONGEST_S),
            metavar="SECONDS",
            help="Go there linearly over so long, in scenario time.",
        ),
    ] = 0.0,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Give the virtual leader another speed; say from which tick on."""
    arguments = {"speed_m_s": speed_m_s, "ramp_s": ramp_s}
    _ask(ctx, "run.leader_speed", arguments, force=force, as_json=as_json)


@app.command()
def leader(
    ctx: typer.Context,
    as_toml: Annotated[
        bool, typer.Option("--toml", help=r"Print the section \[leader] that repeats it.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """List the steps of the leader's speed: of the scenario and ordered ones."""
    from fleetloop.steer.command import print_leader

    print_leader(ctx.obj, as_toml=as_toml, as_json=as_json)


@app.command()
def estop(ctx: typer.Context, force: ForceOption = False, as_json: JsonOption = False) -> None:
    """Trip the e-stop of all drives; the run goes on, and a person has to clear them."""
    from fleetloop.steer.command import stop_drives

    stop_drives(ctx.obj, force=force, as_json=as_json)


@app.command()
def stop(ctx: typer.Context, force: ForceOption = False, as_json: JsonOption = False) -> None:
    """End a run as Ctrl-C does: its record is kept."""
    _ask(ctx, "run.stop", {}, force=force, as_json=as_json)


def _ask(
    ctx: typer.Context, request: str, arguments: dict[str, Any], *, force: bool, as_json: bool
) -> None:
    from fleetloop.steer.command import steer

    steer(ctx.obj, request, arguments, force=force, as_json=as_json)
