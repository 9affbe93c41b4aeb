"""A Dask scheduler that the user has: its address, the certificates for it, a client of it.

All that is wrong with an address or a file is found before there is a client: one that Dask only
half made says so again, with a traceback, when the program ends, and waits for ever for who says
nothing.
"""

import asyncio
import os
import re
import socket
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from configs.errors import InfrastructureError, ScenarioError

ANSWER_S = 20.0
_ADDRESS = re.compile(r"(tcp|tls)://(?P<host>\[[^]]+\]|[^:/]+):(?P<port>\d{1,5})")


@dataclass(frozen=True, slots=True)
class Tls:
    """Files of a cluster's certificates; what isn't given is as in Dask's own settings."""

    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None

    @property
    def files(self) -> dict[str, Path]:
        """Those that are given, by their options."""
        every = {"--tls-ca": self.ca, "--tls-cert": self.certificate, "--tls-key": self.key}
        return {option: path for option, path in every.items() if path is not None}


def client_of_scheduler(distributed: Any, address: str, tls: Tls) -> Any:
    """A client of the scheduler at an address.

    Args:
        distributed: the package, its settings made.
        address: tcp://HOST:PORT, or tls://HOST:PORT.
        tls: files of certificates, for the latter.

    Raises:
        ScenarioError: the address or a file is none, or they don't go together.
        InfrastructureError: nobody answers, or not as such a scheduler.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None:
        remedy = "must be tcp://HOST:PORT or tls://HOST:PORT, for example tcp://192.168.1.2:8786"
        raise ScenarioError(f"--scheduler {address}: {remedy}")
    encrypted = found[1] == "tls"
    security = _security(distributed, address, tls, encrypted=encrypted)
    _knock(address, found["host"].strip("[]"), int(found["port"]))
    such = "with TLS and these certificates" if encrypted else "without TLS"
    try:
        asyncio.run(_shake_hands(distributed, address, security))
        return distributed.Client(
            address, timeout=ANSWER_S, security=security, set_as_default=False
        )
    except (OSError, TimeoutError) as error:
        raise InfrastructureError(
            f"--scheduler {address}: answers, but not as a Dask scheduler {such}: {why(error)}"
        ) from error


def why(error: OSError | TimeoutError) -> str:
    """What went wrong, in words, whatever Dask or asyncio has said of a wait that ran out."""
    if isinstance(error, TimeoutError):
        return f"no answer in {ANSWER_S:g} s"
    return str(error) or type(error).__name__


async def _shake_hands(distributed: Any, address: str, security: Any) -> None:
    """Connect as Dask does, and leave again, within a bound; a client of Dask has none here.

    Raises:
        OSError: who is there is no scheduler, or takes no such certificates.
        TimeoutError: who is there says nothing.
    """
    connection = distributed.comm.connect(
        address, ANSWER_S, **security.get_connection_args("client")
    )
    comm = await asyncio.wait_for(connection, ANSWER_S)
    await comm.close()


def ask(client: Any, question: Callable[..., Any], **arguments: Any) -> Any:
    """What the scheduler of a client answers, within a bound; what Dask asks by itself has none.

    Args:
        client: of Dask.
        question: an operation of `client.scheduler`.
        arguments: its own ones.

    Raises:
        OSError: it has gone.
        TimeoutError: it says nothing.
    """
    return client.sync(question, callback_timeout=ANSWER_S, **arguments)


def _security(distributed: Any, address: str, tls: Tls, *, encrypted: bool) -> Any:
    """Dask's settings of encryption with these files; its own ones hold where none is given.

    Raises:
        ScenarioError: a file is not what it should be, one is missing, or the address has no use
            for them.
    """
    files = tls.files
    if files and not encrypted:
        raise ScenarioError(
            f"--scheduler {address}: has no certificates; with {', '.join(files)} it must be"
            " tls://HOST:PORT"
        )
    for option, path in files.items():
        if not path.is_file():
            raise ScenarioError(f"{option} {path}: no such file")
    fields = {"--tls-ca": "ca_file", "--tls-cert": "client_cert", "--tls-key": "client_key"}
    given: dict[str, Any] = {
        f"tls_{fields[option]}": os.fspath(path) for option, path in files.items()
    }
    if encrypted:
        given["require_encryption"] = True
    security = distributed.Security(**given)
    if not encrypted:
        if security.require_encryption:
            raise ScenarioError(
                f"--scheduler {address}: Dask's own settings require encryption; it must be"
                " tls://HOST:PORT"
            )
        return security
    ca, certificate, key = (getattr(security, f"tls_{field}") for field in fields.values())
    lacks = [option for option, one in (("--tls-ca", ca), ("--tls-cert", certificate)) if not one]
    if lacks:
        raise ScenarioError(
            f"--scheduler {address}: needs {' and '.join(lacks)}, and --tls-key for a key that is"
            " not in the certificate's file"
        )
    _check_files(ca, certificate, key)
    return security


def _check_files(ca: str, certificate: str, key: str | None) -> None:
    """Refuse files that TLS can't use.

    Raises:
        ScenarioError: it names the file, and why.
    """
    try:
        context = ssl.create_default_context(cafile=ca)
    except OSError as error:
        raise ScenarioError(f"{ca}: must be an authority's certificate (PEM): {error}") from error
    try:
        context.load_cert_chain(certificate, key, password=_no_password)
    except (OSError, ValueError) as error:
        beside = f", with its key in {key}" if key else " and its key"
        raise ScenarioError(
            f"{certificate}: must be a certificate (PEM){beside}: {error}"
        ) from error


def _no_password() -> str:
    raise ValueError("the key has a password; nobody is asked for it here")


def _knock(address: str, host: str, port: int) -> None:
    """Refuse an address where nobody listens.

    Raises:
        InfrastructureError: nobody answers.
    """
    try:
        socket.create_connection((host, port), timeout=ANSWER_S).close()
    except (OSError, OverflowError) as error:
        said = getattr(error, "strerror", None) or error
        raise InfrastructureError(f"--scheduler {address}: no scheduler there: {said}") from error
