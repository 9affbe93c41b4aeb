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
from typing import Any, NamedTuple

from bridge.process.clock import SYSTEM_CLOCK
from configs.errors import InfrastructureError, ScenarioError

ANSWER_S = 20.0
_DATE = "%Y-%m-%d %H:%M UTC"
_OF_ANOTHER_KEY = ("KEY_VALUES_MISMATCH", "KEY_TYPE_MISMATCH", "NO_CERTIFICATE_ASSIGNED")
"""What OpenSSL says of a key that doesn't belong to the certificate; the last of another kind."""
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
    such = "with TLS and these certificates" if encrypted else "without TLS"
    host, port = found["host"].strip("[]"), int(found["port"])
    context = security.get_connection_args("client").get("ssl_context")
    connection = _knock(address, host, port)
    try:
        with connection:
            _check_scheduler(connection, address, host, context)
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
        _content(f"{option} {path}", path)
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
    named = {os.fspath(path): f"{option} {path}" for option, path in files.items()}
    _check_files(*(_Named(path, named.get(path, path)) for path in (ca, certificate, key or "")))
    return security


class _Named(NamedTuple):
    """A file of TLS and what it is called in messages, with its option if one gave it."""

    path: str
    name: str


def _content(name: str, path: str | Path) -> bytes:
    """What is in a file.

    Raises:
        ScenarioError: nothing that can be read.
    """
    try:
        content = Path(path).read_bytes()
    except FileNotFoundError:
        raise ScenarioError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise ScenarioError(f"{name}: a folder; must be a file (PEM)") from None
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise ScenarioError(f"{name}: can't be read: {said}") from error
    if not content.strip():
        raise ScenarioError(f"{name}: empty; must be a file in PEM")
    return content


def _check_files(ca: _Named, certificate: _Named, key: _Named) -> None:
    """Refuse files that TLS can't use; the key is in the certificate's file if it has no path.

    Raises:
        ScenarioError: it names the file, and why.
    """
    given = [one for one in (ca, certificate, key) if one.path]
    contents = {one: _content(one.name, one.path) for one in given}
    try:
        context = ssl.create_default_context(cafile=ca.path)
    except OSError as error:
        raise ScenarioError(
            f"{ca.name}: must be an authority's certificate (PEM): {error}"
        ) from error
    beside = f", with its key in {key.path}" if key.path else " and its key"
    try:
        context.load_cert_chain(certificate.path, key.path or None, password=_no_password)
    except (OSError, ValueError) as error:
        if getattr(error, "reason", None) in _OF_ANOTHER_KEY:
            (*_, holder) = given
            raise ScenarioError(
                f"{holder.name}: the key in it is not that of the certificate {certificate.path}"
            ) from error
        raise ScenarioError(
            f"{certificate.name}: must be a certificate (PEM){beside}: {error}"
        ) from error
    _check_dates(certificate.name, contents[certificate])
    _check_dates(ca.name, contents[ca], every=True)


def _check_dates(name: str, content: bytes, *, every: bool = False) -> None:
    """Refuse a file whose first certificate isn't good now; of `every` one that is good is enough.

    Raises:
        ScenarioError: it names the date.
    """
    from cryptography import x509  # only where there are certificates

    try:
        found = x509.load_pem_x509_certificates(content)
    except ValueError:
        return  # OpenSSL takes more than this package does
    now_s = SYSTEM_CLOCK.wall_ns() / 1e9
    spans = [(one.not_valid_before_utc, one.not_valid_after_utc) for one in found]
    if every and any(first.timestamp() <= now_s <= last.timestamp() for first, last in spans):
        return
    first, last = max(spans, key=lambda span: span[1]) if every else spans[0]
    if now_s > last.timestamp():
        raise ScenarioError(f"{name}: the certificate expired on {last:{_DATE}}; renew it")
    if now_s < first.timestamp():
        raise ScenarioError(
            f"{name}: the certificate is not valid before {first:{_DATE}}; is the clock here right?"
        )


def _no_password() -> str:
    raise ValueError(
        "the key has a password, for which nobody is asked here; give one without"
        " (openssl pkey -in KEY -out NEW)"
    )


def _knock(address: str, host: str, port: int) -> socket.socket:
    """A connection to an address.

    Raises:
        InfrastructureError: nobody listens there.
    """
    try:
        return socket.create_connection((host, port), timeout=ANSWER_S)
    except (OSError, OverflowError) as error:
        said = getattr(error, "strerror", None) or error
        raise InfrastructureError(f"--scheduler {address}: no scheduler there: {said}") from error


def _check_scheduler(
    connection: socket.socket, address: str, host: str, context: ssl.SSLContext | None
) -> None:
    """Refuse a scheduler whose certificate is not one of the authority, or not at this time.

    Dask says of it only that the handshake failed. What else can be wrong is left to Dask's own.

    Raises:
        InfrastructureError: it says what is wrong with the certificate.
        TimeoutError: who is there says nothing.
    """
    if context is None:
        return
    try:
        context.wrap_socket(connection, server_hostname=host).close()
    except ssl.SSLCertVerificationError as error:
        raise InfrastructureError(
            f"--scheduler {address}: its certificate can't be trusted: {error.verify_message}"
        ) from error
    except TimeoutError:
        raise
    except OSError:
        return
