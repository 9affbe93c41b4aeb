"""The command line of `fleetloop can VERB ...`: arguments only."""

from pathlib import Path
from typing import Annotated

import typer

from fleetloop.numbers import LONGEST_S, between
from fleetloop.options import JsonOption

app = typer.Typer(
    help="List, monitor, feed, bridge and export the CAN buses of live runs. BUS is a bus (r1), or"
    " run and bus (20261123-101500-paper/r1) if several runs have it.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="rich",
)

BusArg = Annotated[str, typer.Argument(metavar="BUS", help="A live bus, e.g. r1.")]
ProtocolOption = Annotated[
    str,
    typer.Option(
        "--protocol",
        metavar="NAME",
        help="Drive protocol to decode: odrive, or module:ROW of a module in the current folder.",
    ),
]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FILE", help="Output file. Default: standard output."),
]


@app.command("list")
def list_(
    seconds: Annotated[
        float,
        typer.Option(callback=between(0.01, 60.0), metavar="S", help="Listening time."),
    ] = 1.0,
    bit_rate: Annotated[
        int, typer.Option("--bitrate", min=1, metavar="BIT/S", help="Bit rate that load refers to.")
    ] = 1_000_000,
    protocol: ProtocolOption = "odrive",
    as_json: JsonOption = False,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            help="Again and again, in place on a terminal, until Ctrl-C; with --json a line each.",
        ),
    ] = False,
    lasting: Annotated[
        float | None,
        typer.Option(
            "--for",
            callback=between(0.01, LONGEST_S),
            metavar="S",
            help="With --watch: end after this time.",
        ),
    ] = None,
) -> None:
    """List the live buses, by run: clients, nodes, frame rate, load."""
    from fleetloop.can.listing import list_buses
    from fleetloop.can.watching import watch_buses

    if lasting is not None and not watch:
        raise typer.BadParameter("--for: with --watch; the time of a listing is --seconds")
    if watch:
        status = watch_buses(
            seconds=seconds,
            bit_rate=bit_rate,
            as_json=as_json,
            protocol_name=protocol,
            lasting_s=lasting,
        )
    else:
        status = list_buses(
            seconds=seconds, bit_rate=bit_rate, as_json=as_json, protocol_name=protocol
        )
    raise typer.Exit(status)


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
            "-t", metavar="a|d|z|A", help="Timestamp in bus time: absolute, delta, from zero, date."
        ),
    ] = "",
    log_format: Annotated[
        bool, typer.Option("-L", help="Log format, for canplayer, python-can and others.")
    ] = False,
    count: Annotated[
        int | None, typer.Option("-n", min=1, help="End after this number of frames.")
    ] = None,
    silence_ms: Annotated[
        float | None,
        typer.Option(
            "-T",
            callback=between(0.0, 1e12),
            metavar="MS",
            help="End after this time without a frame.",
        ),
    ] = None,
    decode: Annotated[bool, typer.Option("--decode", help="Decode frames of drives.")] = False,
    protocol: ProtocolOption = "odrive",
    ascii_too: Annotated[bool, typer.Option("-a", help="Print data as characters too.")] = False,
    explain_errors: Annotated[bool, typer.Option("-e", help="Explain error frames.")] = False,
    nanoseconds: Annotated[bool, typer.Option("-N", help="Timestamps with nanoseconds.")] = False,
) -> None:
    """Print the frames on buses, as candump does."""
    from fleetloop.can.decoder import protocol_of
    from fleetloop.can.dump import DumpOptions
    from fleetloop.can.dump import dump as dump_buses

    options = DumpOptions(
        stamps=stamps,
        nanoseconds=nanoseconds,
        log_format=log_format,
        ascii_too=ascii_too,
        explain_errors=explain_errors,
        decode=decode,
        drives=protocol_of(protocol),
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
    count: Annotated[
        int, typer.Option("-n", min=1, help="Number of times to send the frames.")
    ] = 1,
    gap_ms: Annotated[
        float,
        typer.Option(
            "-g", callback=between(0.0, 1e12), metavar="MS", help="Time between two frames."
        ),
    ] = 0.0,
) -> None:
    """Send frames to a bus, in cansend's syntax."""
    from fleetloop.can.send import send as send_frames

    raise typer.Exit(send_frames(bus, frames, count=count, gap_s=gap_ms / 1e3))


@app.command()
def gateway(
    bus: BusArg,
    interface: Annotated[
        str,
        typer.Option("--interface", "-i", help="python-can interface: socketcan, slcan, pcan, ..."),
    ],
    channel: Annotated[
        str | None, typer.Option("--channel", "-c", help="Channel: vcan0, /dev/ttyACM0, ...")
    ] = None,
    bitrate: Annotated[
        int | None,
        typer.Option("--bitrate", "-b", min=1, help="Bit rate, if the adapter needs one."),
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", "-o", metavar="KEY=VALUE", help="More arguments of can.Bus."),
    ] = None,
    echo: Annotated[
        str,
        typer.Option(
            metavar="auto|yes|no",
            help="Whether the interface echoes sent frames. auto: by interface type.",
        ),
    ] = "auto",
    retry: Annotated[
        float,
        typer.Option(
            callback=between(0.0, LONGEST_S),
            metavar="S",
            help="Time to retry opening the other bus after it is lost.",
        ),
    ] = 0.0,
    rate: Annotated[
        bool, typer.Option("--rate", help="Add frame rates to the final statistics.")
    ] = False,
) -> None:
    """Bridge a bus and another python-can bus, both ways, until the run ends or Ctrl-C."""
    from fleetloop.can.far_bus import FarBus
    from fleetloop.can.gateway import join

    far = FarBus.parse(interface, channel, bitrate, options or [], echo)
    raise typer.Exit(join(bus, far, retry_s=retry, with_rates=rate))


@app.command()
def slcan(
    bus: BusArg,
    link: Annotated[
        Path | None,
        typer.Option(
            "--link", metavar="PATH", help="Symbolic link to the device, removed at the end."
        ),
    ] = None,
) -> None:
    """Offer a bus as a serial slcan (LAWICEL) adapter; print the device to open."""
    from fleetloop.can.slcan import offer

    raise typer.Exit(offer(bus, link))


@app.command()
def endpoints(
    bus: Annotated[
        str | None,
        typer.Argument(metavar="BUS", help="A live bus, to read the versions of its drives."),
    ] = None,
    firmware: Annotated[
        str | None,
        typer.Option(
            "--fw-version",
            metavar="VERSION",
            help="Firmware version, instead of a bus, e.g. 0.6.11.",
        ),
    ] = None,
    out: OutOption = None,
    protocol: ProtocolOption = "odrive",
) -> None:
    """Print the endpoints of the drives in the form of the vendor's flat_endpoints.json."""
    from fleetloop.can.endpoints import write_endpoints

    raise typer.Exit(write_endpoints(bus, firmware, out, protocol))


@app.command()
def dbc(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENARIO|RUN",
            help="A scenario or a run, for the addresses of its drives. Default: two drives, 0, 1.",
        ),
    ] = None,
    out: OutOption = None,
    bus: Annotated[
        str | None, typer.Option("--bus", metavar="BUS", help="Only the drives on this bus.")
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option("--protocol", metavar="NAME", help="Drive protocol, without SCENARIO or RUN."),
    ] = None,
) -> None:
    """Print the frames of the drives as a CAN database (DBC), for cantools, SavvyCAN and others."""
    from fleetloop.can.dbc import write_dbc

    raise typer.Exit(write_dbc(source, out, bus=bus, protocol_name=protocol))
