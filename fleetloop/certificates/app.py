"""The command line of `fleetloop certs VERB ...`: arguments, and what is said of the result."""

from pathlib import Path
from typing import Annotated

import typer

DAYS, AUTHORITY_DAYS, MOST_DAYS = 365, 3650, 36500

app = typer.Typer(
    help="Make, renew and revoke the certificates of a fleet: an authority, the router's, one for"
    " each identity on another machine. A deployment names the folder: network.certificates.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="rich",
)
FolderArg = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the certificates.")]
DaysOption = Annotated[
    int, typer.Option(min=1, max=MOST_DAYS, metavar="N", help="Days for which they are good.")
]
HostOption = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        metavar="NAME",
        help="A name or address at which clients reach the router. May be repeated.",
    ),
]


@app.command()
def init(
    folder: FolderArg,
    hosts: HostOption = None,
    days: DaysOption = DAYS,
    authority_days: Annotated[
        int, typer.Option(min=1, max=MOST_DAYS, metavar="N", help="Days of the authority itself.")
    ] = AUTHORITY_DAYS,
) -> None:
    """Make an authority and the router's certificate in a new folder."""
    from fleetloop.certificates.folder import CertificateFolder
    from fleetloop.terminal import say

    made = CertificateFolder(folder)
    made.create(hosts or (), days=days, authority_days=authority_days)
    say(
        f"wrote {folder}: an authority, and the router's certificate for {', '.join(hosts or ())},"
        f" good until {made.certificate('router').not_valid_after_utc:%Y-%m-%d}\n"
        f"next: fleetloop certs robot {folder} agent-r1\n"
        f"keep {folder / 'ca.key'} to yourself: no run needs it"
    )


@app.command()
def robot(
    folder: FolderArg,
    identities: Annotated[
        list[str],
        typer.Argument(
            metavar="IDENTITY...",
            help="agent-r1 for the controller of r1, plant, localisation, recorder, launcher.",
        ),
    ],
    guest: Annotated[
        bool, typer.Option("--guest", help="They are guests of buses (network.guests).")
    ] = False,
    days: DaysOption = DAYS,
) -> None:
    """Make a key and a certificate for identities on other machines."""
    from fleetloop.certificates.folder import CertificateFolder
    from fleetloop.terminal import say

    for identity in identities:
        made = CertificateFolder(folder).issue(identity, days=days, guest=guest)
        say(
            f"{identity}: good until {made.not_valid_after_utc:%Y-%m-%d}; copy ca.pem,"
            f" {identity}.pem and {identity}.key to its machine, and keep no copy of the key"
        )


@app.command()
def renew(
    folder: FolderArg,
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Identities, or router.")],
    hosts: HostOption = None,
    days: DaysOption = DAYS,
) -> None:
    """Prolong certificates. The key stays: only the certificate has to be copied again."""
    from fleetloop.certificates.folder import CertificateFolder
    from fleetloop.terminal import say

    for name in names:
        made = CertificateFolder(folder).renew(name, days=days, hosts=hosts or ())
        say(f"{name}: good until {made.not_valid_after_utc:%Y-%m-%d}; copy {name}.pem")


@app.command()
def revoke(
    folder: FolderArg,
    identities: Annotated[list[str], typer.Argument(metavar="IDENTITY...", help="Identities.")],
) -> None:
    """Revoke the key of an identity: from the next start of a router on it is refused."""
    from fleetloop.certificates.folder import CertificateFolder
    from fleetloop.terminal import say

    for identity in identities:
        gone = CertificateFolder(folder).revoke(identity)
        say(
            f"{identity}: revoked ({len(gone)} certificate{'s' if len(gone) > 1 else ''});"
            f" routers that start from now on refuse it; a new key: fleetloop certs robot"
            f" {folder} {identity}"
        )
