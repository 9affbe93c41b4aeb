"""Router endpoint and credentials of a client on another machine.

    option         what
    endpoint       tcp/HOST:PORT, or tls/HOST:PORT for mutual TLS
    user           a guest of the run's deployment; with TLS whom its certificate is for
    password       with tcp: the one in the deployment's file of users,
    users          or a file of the program's own with the line USER:PASSWORD
    ca             with tls: the authority of the router's certificate and the guest's, PEM
    certificate    with tls: the guest's, PEM
    private_key    with tls: the guest's, PEM

Over tcp frames are neither encrypted nor authenticated: use it on trusted networks only.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from bridge.can_bus.options import TLS, as_option
from bridge.network.tls import check_tls
from configs.connections import NetworkLink
from configs.errors import ScenarioError
from configs.files import expanded
from configs.tls import TlsFiles
from configs.users import read_users

_ENDPOINT = re.compile(r"(tcp|tls)/.+:\d+")


def network_of(options: Mapping[str, str]) -> NetworkLink:
    """How to reach the router, from the options that were given.

    Raises:
        ScenarioError: an option is missing, wrong, or doesn't go with the others.
    """
    endpoint, user = options.get("endpoint"), options.get("user")
    if not endpoint or not user:
        raise ScenarioError(
            "from another machine give endpoint and user, with password or users over tcp, with"
            f" {', '.join(TLS)} over tls; given: {', '.join(sorted(options))}"
        )
    if not _ENDPOINT.fullmatch(endpoint):
        raise ScenarioError(f"endpoint = {endpoint!r}: must be tcp/HOST:PORT or tls/HOST:PORT")
    secure = endpoint.startswith("tls/")
    needed, others = (TLS, ("password", "users")) if secure else (("password",), TLS)
    if wrong := [name for name in others if name in options]:
        raise ScenarioError(f"{wrong[0]} doesn't go with {endpoint}: give {', '.join(needed)}")
    if secure:
        files = _tls(options)
        return NetworkLink("", endpoint, user, check_tls(files, user), files)
    return NetworkLink("", endpoint, user, _password(options, user))


def _tls(options: Mapping[str, str]) -> TlsFiles:
    for name in TLS:
        if name not in options:
            raise ScenarioError(f"{name} = (missing): over tls give {', '.join(TLS)}")
    return TlsFiles(**{name: Path(options[name]) for name in TLS})


def _password(options: Mapping[str, str], user: str) -> str:
    if ("password" in options) == ("users" in options):
        raise ScenarioError("over tcp give either password or users")
    if "password" in options:
        return as_option(options["password"])
    path = expanded(Path(options["users"]), "users")
    known = read_users(path, "users")
    if not known.get(user):
        raise ScenarioError(f"users = {path}: no line {user}:<password>")
    return as_option(known[user])
