"""Checks of the files of mutual TLS before a connection: present, matching, valid, whose.

A certificate is shown to oneself, in memory: the same checks that the other end will make.
"""

import contextlib
import ssl
from collections.abc import Iterator
from typing import Any

from configs.errors import ScenarioError
from configs.tls import TlsFiles, identity_and_number

_CN = "commonName"
_FLIGHTS = 4
"""Of messages in a handshake; TLS 1.2 has as many."""


def check_tls(files: TlsFiles, identity: str | None, key: str = "", host: str = "") -> str:
    """Refuse files that can't prove `identity`; None: those of the router, whose name is its own.

    `key` stands before the names ca, certificate and private_key in messages; `host` is where
    clients reach the router. Returns the certificate's common name.

    Raises:
        ScenarioError: naming key and file.
    """
    named = {
        f"{key}ca": (files.ca, "CERTIFICATE-----"),
        f"{key}certificate": (files.certificate, "CERTIFICATE-----"),
        f"{key}private_key": (files.private_key, "PRIVATE KEY-----"),
    }
    for name, (path, mark) in named.items():
        try:
            text = path.read_bytes()
        except OSError as error:
            raise ScenarioError(f"{name} = {path}: {error.strerror}") from error
        if mark.encode() not in text:
            kind = "private key" if "KEY" in mark else "certificate"
            raise ScenarioError(f"{name} = {path}: no {kind} in PEM")
        if b"ENCRYPTED" in text:
            raise ScenarioError(f"{name} = {path}: is encrypted; a service can't ask for its word")
    names = _common_names(files, key, host, ours_listens=identity is None)
    proved = [name for name in names if identity in (None, identity_and_number(name)[0])]
    if identity is not None and not proved:
        raise ScenarioError(
            f"{key}certificate = {files.certificate}: is the certificate of"
            f" {', '.join(map(repr, names)) or 'nobody'} (its common name), not of {identity!r}"
        )
    return proved[0] if proved else ""


def _common_names(files: TlsFiles, key: str, host: str, *, ours_listens: bool) -> list[str]:
    """Whose the certificate is."""
    ours, other = ssl.PROTOCOL_TLS_CLIENT, ssl.PROTOCOL_TLS_SERVER
    if ours_listens:
        ours, other = other, ours
    shows, checks = ssl.SSLContext(ours), ssl.SSLContext(other)
    shows.check_hostname = checks.check_hostname = False
    shows.verify_mode, checks.verify_mode = ssl.CERT_NONE, ssl.CERT_REQUIRED
    checks.check_hostname = bool(host)
    with _blamed(f"{key}ca = {files.ca}"):
        checks.load_verify_locations(files.ca)
    together = f"{key}certificate = {files.certificate} and {key}private_key = {files.private_key}"
    with _blamed(together):
        for context in (shows, checks):
            context.load_cert_chain(files.certificate, files.private_key)
    with _blamed(f"{key}certificate = {files.certificate}: by {key}ca = {files.ca}"):
        shown = _shown(shows, checks, host, ours_listens=ours_listens) or {}
    return [str(value) for part in shown.get("subject", ()) for name, value in part if name == _CN]


def _shown(
    shows: ssl.SSLContext, checks: ssl.SSLContext, host: str, *, ours_listens: bool
) -> dict[str, Any] | None:
    """The certificate as the checking end sees it."""
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    ours = shows.wrap_bio(down, up, server_side=ours_listens)
    other = checks.wrap_bio(up, down, server_side=not ours_listens, server_hostname=host or None)
    unfinished = [ours, other]
    for _ in range(_FLIGHTS):
        for end in tuple(unfinished):
            with contextlib.suppress(ssl.SSLWantReadError):
                end.do_handshake()
                unfinished.remove(end)
    return None if other in unfinished else other.getpeercert()


@contextlib.contextmanager
def _blamed(what: str) -> Iterator[None]:
    try:
        yield
    except ssl.SSLCertVerificationError as error:
        raise ScenarioError(f"{what}: {error.verify_message}") from error
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).replace("_", " ").lower()
        raise ScenarioError(f"{what}: {reason}") from error
