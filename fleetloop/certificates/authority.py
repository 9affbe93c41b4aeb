"""X.509 certificates of a fleet (RFC 5280): an authority, the router's, identities'. Pure.

Keys are on the curve P-256, signatures ECDSA with SHA-256. The router's certificate is good for a
server only and an identity's for a client only (extended key usage), so that no robot can pass for
the router.
"""

import ipaddress
import re
import secrets
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.types import CertificatePublicKeyTypes
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from configs.errors import ScenarioError
from configs.tls import ROUTER

BACKDATED = timedelta(hours=1)
"""A machine whose clock is behind by less takes a new certificate at once."""
MOST_NAME = 64
"""Characters of a common name (RFC 5280, ub-common-name)."""
_HOST = re.compile(r"(?=.{1,253}$)[A-Za-z0-9]([A-Za-z0-9-]{0,62}\.?)*")


class Authority(NamedTuple):
    """The certificate of an authority, and the key that signs."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def new_key() -> ec.EllipticCurvePrivateKey:
    """A key on the curve P-256."""
    return ec.generate_private_key(ec.SECP256R1())


def new_authority(now: datetime, days: int) -> Authority:
    """An authority that signs itself; its name is one of its own."""
    key = new_key()
    name = _name(f"Fleetloop authority {secrets.token_hex(4)}")
    builder = (
        _builder(name, name, key.public_key(), now, now + timedelta(days=days))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs=True), critical=True)
    )
    return Authority(builder.sign(key, hashes.SHA256()), key)


def certify_router(
    authority: Authority,
    public_key: CertificatePublicKeyTypes,
    hosts: Sequence[str],
    now: datetime,
    until: datetime,
) -> x509.Certificate:
    """The router's certificate, for the hosts at which clients reach it.

    Raises:
        ScenarioError: no host, or one that is neither a host's name nor an address.
    """
    if not hosts:
        raise ScenarioError("--host: give the names or addresses at which robots reach the router")
    names = x509.SubjectAlternativeName([host_name(host) for host in hosts])
    builder = _leaf(authority, ROUTER, public_key, now, until)
    builder = builder.add_extension(names, critical=False)
    return _signed(authority, builder, ExtendedKeyUsageOID.SERVER_AUTH)


def certify_identity(
    authority: Authority,
    public_key: CertificatePublicKeyTypes,
    common_name: str,
    now: datetime,
    until: datetime,
) -> x509.Certificate:
    """The certificate of an identity.

    Raises:
        ScenarioError: the common name is longer than a certificate can say.
    """
    if len(common_name) > MOST_NAME:
        raise ScenarioError(f"{common_name}: longer than the {MOST_NAME} characters of a name")
    builder = _leaf(authority, common_name, public_key, now, until)
    return _signed(authority, builder, ExtendedKeyUsageOID.CLIENT_AUTH)


def revocation_list(
    authority: Authority, revoked: Sequence[x509.RevokedCertificate], now: datetime
) -> x509.CertificateRevocationList:
    """The signed list of what is revoked; good for as long as the authority is."""
    builder = (
        x509.CertificateRevocationListBuilder()
        .issuer_name(authority.certificate.subject)
        .last_update(now)
        .next_update(authority.certificate.not_valid_after_utc)
    )
    for entry in revoked:
        builder = builder.add_revoked_certificate(entry)
    return builder.sign(authority.key, hashes.SHA256())


def revocation(serial: int, now: datetime) -> x509.RevokedCertificate:
    """An entry of the list."""
    return x509.RevokedCertificateBuilder().serial_number(serial).revocation_date(now).build()


def host_name(host: str) -> x509.GeneralName:
    """A host's address or name as certificates say it.

    Raises:
        ScenarioError: it is neither.
    """
    try:
        return x509.IPAddress(ipaddress.ip_address(host.strip("[]")))
    except ValueError:
        if not _HOST.fullmatch(host):
            raise ScenarioError(
                f"--host {host}: must be a host's name or address, for example base.local"
            ) from None
        return x509.DNSName(host)


def hosts_of(certificate: x509.Certificate) -> list[str]:
    """The hosts that a router's certificate is for."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return []
    return [str(name.value) for name in names]


def common_name(certificate: x509.Certificate) -> str:
    """The common name of a certificate, "" if it has none."""
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else ""


def pem_of(key: ec.EllipticCurvePrivateKey) -> bytes:
    """A private key in PEM (PKCS #8), not encrypted: services read it."""
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def _leaf(
    authority: Authority,
    common_name: str,
    public_key: CertificatePublicKeyTypes,
    now: datetime,
    until: datetime,
) -> x509.CertificateBuilder:
    issuer = authority.certificate
    key_id = issuer.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value
    return (
        _builder(_name(common_name), issuer.subject, public_key, now, until)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(key_id), critical=False
        )
    )


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    public_key: CertificatePublicKeyTypes,
    now: datetime,
    until: datetime,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(now, until) - BACKDATED)
        .not_valid_after(until)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public_key), critical=False)
    )


def _signed(
    authority: Authority, builder: x509.CertificateBuilder, purpose: x509.ObjectIdentifier
) -> x509.Certificate:
    builder = builder.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
    return builder.sign(authority.key, hashes.SHA256())


def _usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])
