"""The command line of `fleetloop can VERB ...`: arguments only."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop.numbers import LONGEST_S, between

app = typer.Typer(
    help="Look at, feed, join and offer the CAN buses of runs that are up. BUS is a bus (r1), or"
    " run and bus (20261123-101500-paper/r1) if several runs have it.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="rich",
)

BusArg = Annotated[str, typer.Argument(metavar="BUS", help="A bus that is up, e.g. r1.")]


@app.command("list")
def list_(
    seconds: Annotated[
        float,
        typer.Option(callback=between(0.01, 60.0), metavar="S", help="How long to listen."),
    ] = 1.0,
    bit_rate: Annotated[
        int, typer.Option("--bitrate", min=1, metavar="BIT/S", help="What load is a share of.")
    ] = 1_000_000,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the buses that are up, by run: clients, nodes, frame rate, load."""
    from fleetloop.can.listing import list_buses

    raise typer.Exit(list_buses(seconds=seconds, bit_rate=bit_rate, as_json=as_json))


@app.command()
def dump(
    buses: Annotated[
        list[str],
        typer.Argument(
            metavar="BUS[,FILTER]...",
            help="Buses, or any for all; filters as candump's: ID:MASK, ID~MASK, #ERRORMASK, j.",
        ),
    ],
    stamps: Annotated[
        str,
        typer.Option(
            "-t", metavar="a|d|z|A", help="Time: absolute, delta, from zero, as a date. Bus time."
        ),
    ] = "",
    log_format: Annotated[
        bool, typer.Option("-L", help="Log format, for canplayer, python-can and others.")
    ] = False,
    count: Annotated[
        int | None, typer.Option("-n", min=1, help="End after so many frames.")
    ] = None,
    silence_ms: Annotated[
        float | None,
        typer.Option("-T", callback=between(0.0, 1e12), metavar="MS", help="End after a silence."),
    ] = None,
    decode: Annotated[
        bool, typer.Option("--decode", help="Say what CANSimple frames mean.")
    ] = False,
    ascii_too: Annotated[bool, typer.Option("-a", help="Data as characters too.")] = False,
    explain_errors: Annotated[bool, typer.Option("-e", help="Error frames in words.")] = False,
    nanoseconds: Annotated[bool, typer.Option("-N", help="Time to the nanosecond.")] = False,
) -> None:
    """Print what goes over buses, as candump does."""
    from fleetloop.can.dump import DumpOptions
    from fleetloop.can.dump import dump as dump_buses

    options = DumpOptions(
        stamps=stamps,
        nanoseconds=nanoseconds,
        log_format=log_format,
        ascii_too=ascii_too,
        explain_errors=explain_errors,
        decode=decode,
        count=count,
        silence_s=None if silence_ms is None else silence_ms / 1e3,
    )
    raise typer.Exit(dump_buses(buses, options))


@app.command()
def send(
    bus: BusArg,
    frames: Annotated[
        list[str],
        typer.Argument(metavar="FRAME...", help="123#DEADBEEF, 123#R, 123#R8, 1F334455#11.22"),
    ],
    count: Annotated[int, typer.Option("-n", min=1, help="Send them so many times.")] = 1,
    gap_ms: Annotated[
        float,
        typer.Option(
            "-g", callback=between(0.0, 1e12), metavar="MS", help="Time between two frames."
        ),
    ] = 0.0,
) -> None:
    """Put frames on a bus, in cansend's syntax."""
    from fleetloop.can.send import send as send_frames

    raise typer.Exit(send_frames(bus, frames, count=count, gap_s=gap_ms / 1e3))


@app.command()
def gateway(
    bus: BusArg,
    interface: Annotated[
        str,
        typer.Option(
            "--interface", "-i", help="python-can's: socketcan, slcan, socketcand, pcan, ..."
        ),
    ],
    channel: Annotated[
        str | None, typer.Option("--channel", "-c", help="vcan0, /dev/ttyACM0, ...")
    ] = None,
    bitrate: Annotated[
        int | None, typer.Option("--bitrate", "-b", min=1, help="For adapters that need it.")
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", "-o", metavar="KEY=VALUE", help="More for can.Bus; repeatable."),
    ] = None,
    echo: Annotated[
        str,
        typer.Option(
            metavar="auto|yes|no",
            help="Whether the interface hands back what is sent to it. auto: as known of it.",
        ),
    ] = "auto",
    retry: Annotated[
        float,
        typer.Option(
            callback=between(0.0, LONGEST_S),
            metavar="S",
            help="When the other bus is lost, try so long to open it again.",
        ),
    ] = 0.0,
    rate: Annotated[
        bool, typer.Option("--rate", help="Frame rates in the statistics at the end.")
    ] = False,
) -> None:
    """Join a bus to another python-can bus, both ways, until the run ends or Ctrl-C."""
    from fleetloop.can.far_bus import FarBus
    from fleetloop.can.gateway import join

    far = FarBus.parse(interface, channel, bitrate, options or [], echo)
    raise typer.Exit(join(bus, far, retry_s=retry, with_rates=rate))


@app.command()
def slcan(
    bus: BusArg,
    link: Annotated[
        Path | None,
        typer.Option("--link", metavar="PATH", help="A name for the device; gone at the end."),
    ] = None,
) -> None:
    """Offer a bus as a serial slcan (LAWICEL) adapter; prints the device to open."""
    from fleetloop.can.slcan import offer

    raise typer.Exit(offer(bus, link))


@app.command()
def endpoints(
    bus: Annotated[
        str | None,
        typer.Argument(metavar="[BUS]", help="A bus that is up: its drives say their versions."),
    ] = None,
    firmware: Annotated[
        str | None,
        typer.Option(
            "--fw-version", metavar="VERSION", help="Without a bus: of this firmware, e.g. 0.6.11."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Write it there instead of printing it."),
    ] = None,
) -> None:
    """Print the endpoints of the drives in the form of the vendor's flat_endpoints.json."""
    from fleetloop.can.endpoints import write_endpoints

    raise typer.Exit(write_endpoints(bus, firmware, out))
