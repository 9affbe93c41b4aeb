"""The folder of `fleetloop certs` on disk; its layout is in `configs.tls`.

Private keys are readable by their owner alone, and a file is there whole or not at all. Renewing
keeps the key, so that it never leaves its machine: only the certificate is copied. A new key comes
with revoking the old one. No certificate outlives its authority, and no two end at one second.
"""

import contextlib
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TypeVar

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.errors import InfrastructureError, ScenarioError
from configs.patterns import NAME
from configs.roles import ROLES
from configs.tls import (
    AUTHORITY,
    CERTIFICATE_SUFFIX,
    ISSUED,
    KEY_SUFFIX,
    REVOKED,
    ROUTER,
    common_name_of,
    identity_and_number,
)
from fleetloop.certificates import authority as x509_of
from fleetloop.certificates.authority import Authority

_PRIVATE, _PUBLIC, _FOLDER = 0o600, 0o644, 0o700
_Read = TypeVar("_Read")


class CertificateFolder:
    """An authority and what it signed."""

    def __init__(self, path: Path, *, clock: Clock = SYSTEM_CLOCK) -> None:
        self.path = path
        self._clock = clock

    # --- with the authority's key ------------------------------------------------------------

    def create(self, hosts: Sequence[str], *, days: int, authority_days: int) -> None:
        """Make the folder with an authority and the router's certificate for these hosts.

        Raises:
            ScenarioError: the folder exists, or a host is none.
            InfrastructureError: it can't be written.
        """
        now = self._now()
        authority = x509_of.new_authority(now, authority_days)
        key = x509_of.new_key()
        router = x509_of.certify_router(
            authority, key.public_key(), hosts, now, self._until(authority, days)
        )
        if self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
            raise ScenarioError(f"{self.path}: exists already; name a new folder")
        with _named(self.path):
            self.path.mkdir(mode=_FOLDER, parents=True, exist_ok=True)
            self.path.chmod(_FOLDER)
            (self.path / ISSUED).mkdir(mode=_FOLDER)
        self._write_key(AUTHORITY, authority.key)
        self._write(f"{AUTHORITY}{CERTIFICATE_SUFFIX}", _pem(authority.certificate))
        self._write_revoked(authority, [])
        self._write_key(ROUTER, key)
        self._write_certificate(ROUTER, router)

    def issue(self, identity: str, *, days: int, guest: bool = False) -> x509.Certificate:
        """A new key and certificate for an identity that has none, or a revoked one.

        Raises:
            ScenarioError: no such identity, or it has a certificate; or no authority is here.
        """
        _check_identity(identity, guest=guest)
        authority = self._authority()
        if self._file(identity).exists() and not self.is_revoked(self.certificate(identity)):
            raise ScenarioError(
                f"{self._file(identity)}: exists already; `fleetloop certs renew` prolongs it,"
                " `revoke` makes way for a new key"
            )
        used = [identity_and_number(x509_of.common_name(it)) for it in self._issued()]
        number = 1 + max((n for name, n in used if name == identity), default=0)
        key, name = x509_of.new_key(), common_name_of(identity, number)
        now, until = self._now(), self._until(authority, days)
        made = x509_of.certify_identity(authority, key.public_key(), name, now, until)
        self._write_key(identity, key)
        self._write_certificate(identity, made)
        return made

    def renew(self, name: str, *, days: int, hosts: Sequence[str] = ()) -> x509.Certificate:
        """A new certificate for the same key; the router's for other hosts if some are given.

        Raises:
            ScenarioError: it has no certificate here, or a revoked one; or no authority is here.
        """
        authority, old = self._authority(), self.certificate(name)
        if self.is_revoked(old):
            raise ScenarioError(
                f"{self._file(name)}: is revoked; `fleetloop certs robot` makes a new key"
            )
        if hosts and name != ROUTER:
            raise ScenarioError(f"--host: is for the router's certificate, not for {name}'s")
        now, until, key = self._now(), self._until(authority, days), old.public_key()
        if name == ROUTER:
            at = hosts or x509_of.hosts_of(old)
            made = x509_of.certify_router(authority, key, at, now, until)
        else:
            said = x509_of.common_name(old)
            made = x509_of.certify_identity(authority, key, said, now, until)
        self._write_certificate(name, made)
        return made

    def revoke(self, identity: str) -> list[x509.Certificate]:
        """Revoke all certificates of an identity's present key; return them.

        Raises:
            ScenarioError: it has none here, or is the router; or no authority is here.
        """
        if identity == ROUTER:
            raise ScenarioError(
                f"{identity}: Zenoh's clients read no list of what is revoked; make a new authority"
                " (`fleetloop certs init`) with new certificates for all"
            )
        authority, present = self._authority(), self.certificate(identity)
        if self.is_revoked(present):
            raise ScenarioError(f"{self._file(identity)}: is revoked already")
        name, now = x509_of.common_name(present), self._now()
        old = [it for it in self._issued() if x509_of.common_name(it) == name]
        fresh = [x509_of.revocation(it.serial_number, now) for it in old]
        self._write_revoked(authority, [*self._revoked(), *fresh])
        (self.path / f"{identity}{KEY_SUFFIX}").unlink(missing_ok=True)
        return old

    # --- without it --------------------------------------------------------------------------

    def certificate(self, name: str) -> x509.Certificate:
        """The present certificate of the router or an identity, signed by the authority here.

        Raises:
            ScenarioError: there is none, or none of this authority.
        """
        file, ca = self._file(name), self._authority_certificate()
        if not file.exists():
            known = sorted({identity_and_number(x509_of.common_name(c))[0] for c in self._issued()})
            raise ScenarioError(
                f"{name}: no certificate in {self.path} (there are: {', '.join(known)});"
                f" `fleetloop certs robot {self.path} {name}` makes one"
            )
        made = _read(file, x509.load_pem_x509_certificate, "certificate")
        try:
            made.verify_directly_issued_by(ca)
        except (ValueError, TypeError, InvalidSignature):
            raise ScenarioError(
                f"{file}: is not signed by {self._file(AUTHORITY)}, but by another authority"
            ) from None
        return made

    def is_revoked(self, certificate: x509.Certificate) -> bool:
        """Whether the authority's list names it.

        Raises:
            ScenarioError: there is no list, or it isn't the authority's.
        """
        return certificate.serial_number in {it.serial_number for it in self._revoked()}

    def proved_name(self, identity: str) -> str:
        """The common name that proves an identity to a router at present.

        Raises:
            ScenarioError: its certificate is missing, foreign, revoked or out of date.
        """
        file, made = self._file(identity), self.certificate(identity)
        if self.is_revoked(made):
            remedy = f"`fleetloop certs robot {self.path} {identity}` makes a new key"
            raise ScenarioError(f"{file}: is revoked; {remedy}")
        now = self._now()
        for certificate, at in ((self._authority_certificate(), AUTHORITY), (made, identity)):
            if now > certificate.not_valid_after_utc:
                raise ScenarioError(
                    f"{self._file(at)}: has expired, on"
                    f" {certificate.not_valid_after_utc:%Y-%m-%d %H:%M} UTC;"
                    + (
                        " make a new authority: `fleetloop certs init`"
                        if at == AUTHORITY
                        else f" `fleetloop certs renew {self.path} {identity}`"
                    )
                )
        name = x509_of.common_name(made)
        if identity_and_number(name)[0] != identity:
            raise ScenarioError(f"{file}: is the certificate of {name!r}, not of {identity!r}")
        return name

    def expiries(self) -> Mapping[int, str]:
        """The identities of all certificates by their last second, in seconds since 1970 UTC."""
        return {
            int(it.not_valid_after_utc.timestamp()): identity_and_number(x509_of.common_name(it))[0]
            for it in self._issued()
        }

    # --- files -------------------------------------------------------------------------------

    def _file(self, name: str) -> Path:
        return self.path / f"{name}{CERTIFICATE_SUFFIX}"

    def _now(self) -> datetime:
        return datetime.fromtimestamp(self._clock.wall_ns() * 1e-9, UTC).replace(microsecond=0)

    def _until(self, authority: Authority, days: int) -> datetime:
        """The last second of a new certificate: its own, by which a router's refusal names it."""
        taken = {it.not_valid_after_utc for it in self._issued()}
        until = min(self._now() + timedelta(days=days), authority.certificate.not_valid_after_utc)
        while until in taken:
            until -= timedelta(seconds=1)
        return until

    def _authority(self) -> Authority:
        certificate = self._authority_certificate()
        if self._now() > certificate.not_valid_after_utc:
            raise ScenarioError(
                f"{self._file(AUTHORITY)}: the authority has expired, on"
                f" {certificate.not_valid_after_utc:%Y-%m-%d %H:%M} UTC; make a new one:"
                " `fleetloop certs init`"
            )
        file = self.path / f"{AUTHORITY}{KEY_SUFFIX}"
        if not file.exists():
            raise ScenarioError(f"{file}: not here; only where it is can certificates be made")
        if file.stat().st_mode & 0o077:
            raise ScenarioError(f"{file}: others may read it; chmod 600 {file}")
        key = _read(file, lambda pem: serialization.load_pem_private_key(pem, None), "private key")
        if not isinstance(key, ec.EllipticCurvePrivateKey) or (
            key.public_key() != certificate.public_key()
        ):
            raise ScenarioError(f"{file}: is not the key of {self._file(AUTHORITY)}")
        return Authority(certificate, key)

    def _authority_certificate(self) -> x509.Certificate:
        file = self._file(AUTHORITY)
        if not file.exists():
            raise ScenarioError(
                f"{self.path}: no folder of `fleetloop certs` ({file.name} is not there);"
                f" `fleetloop certs init {self.path} --host HOST` makes one"
            )
        return _read(file, x509.load_pem_x509_certificate, "certificate")

    def _issued(self) -> list[x509.Certificate]:
        with _named(self.path / ISSUED):
            files = sorted((self.path / ISSUED).glob(f"*{CERTIFICATE_SUFFIX}"))
        return [_read(file, x509.load_pem_x509_certificate, "certificate") for file in files]

    def _revoked(self) -> list[x509.RevokedCertificate]:
        file = self.path / REVOKED
        listed = _read(file, x509.load_pem_x509_crl, "list of what is revoked")
        key = self._authority_certificate().public_key()
        if not isinstance(key, ec.EllipticCurvePublicKey) or not listed.is_signature_valid(key):
            raise ScenarioError(f"{file}: is not signed by {self._file(AUTHORITY)}")
        return list(listed)

    def _write_revoked(
        self, authority: Authority, revoked: Sequence[x509.RevokedCertificate]
    ) -> None:
        made = x509_of.revocation_list(authority, revoked, self._now())
        self._write(REVOKED, made.public_bytes(serialization.Encoding.PEM))

    def _write_key(self, name: str, key: ec.EllipticCurvePrivateKey) -> None:
        self._write(f"{name}{KEY_SUFFIX}", x509_of.pem_of(key), _PRIVATE)

    def _write_certificate(self, name: str, made: x509.Certificate) -> None:
        """First into the history, without which it could not be revoked."""
        self._write(f"{ISSUED}/{made.serial_number:x}{CERTIFICATE_SUFFIX}", _pem(made))
        self._write(f"{name}{CERTIFICATE_SUFFIX}", _pem(made))

    def _write(self, name: str, data: bytes, mode: int = _PUBLIC) -> None:
        file = self.path / name
        fresh = file.with_name(f".{file.name}.new")
        with _named(file):
            fresh.unlink(missing_ok=True)
            opened = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
            with os.fdopen(opened, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            fresh.replace(file)


def _check_identity(identity: str, *, guest: bool) -> None:
    """Refuse what no run has as an identity."""
    roles = [role for role in ROLES if role.identity() != ROUTER]
    prefixes = [role.identity() for role in roles if role.per_robot]
    known = [role.identity() for role in roles if not role.per_robot]
    of_robot = any(
        identity.startswith(prefix) and re.fullmatch(NAME, identity.removeprefix(prefix))
        for prefix in prefixes
    )
    if guest:
        if identity in (*known, AUTHORITY, ROUTER) or not re.fullmatch(NAME, identity):
            raise ScenarioError(
                f"{identity}: can't be a guest's name: lower-case letters, digits and _, none of"
                f" {', '.join((*known, AUTHORITY, ROUTER))}"
            )
    elif identity not in known and not of_robot:
        meant = f" ({prefixes[0]}{identity} is a robot's)" if re.fullmatch(NAME, identity) else ""
        raise ScenarioError(
            f"{identity}: no identity of a run{meant}; known:"
            f" {', '.join([f'{prefix}<robot>' for prefix in prefixes] + known)}; a guest of buses"
            " needs --guest"
        )


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(serialization.Encoding.PEM)


def _read(file: Path, load: Callable[[bytes], _Read], kind: str) -> _Read:
    try:
        return load(file.read_bytes())
    except OSError as error:
        raise ScenarioError(f"{file}: {error.strerror}") from error
    except (ValueError, TypeError) as error:
        raise ScenarioError(f"{file}: no {kind} in PEM") from error


@contextlib.contextmanager
def _named(file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InfrastructureError(f"can't write {file}: {error.strerror}") from error
