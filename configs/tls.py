"""Files of mutual TLS: section [network.tls] of a deployment, and the folder of `fleetloop certs`.

    ca.pem, ca.key            the authority; its key is needed to issue, never to run
    router.pem, router.key    of the machine with the router
    NAME.pem, NAME.key        of an identity: agent-r1, plant, a guest
    crl.pem, issued/          of the authority: what is revoked, and all that it ever signed

A certificate's common name is the identity, from the second key on with a number: agent-r1#2.
Processes receive `TlsFiles` as it is.
"""

from dataclasses import dataclass, field
from pathlib import Path

from configs.parameters import FilePath, Parameters

AUTHORITY, ROUTER = "ca", "router"
"""Names in a folder that no identity can have."""
CERTIFICATE_SUFFIX, KEY_SUFFIX = ".pem", ".key"
REVOKED, ISSUED = "crl.pem", "issued"
_NUMBER = "#"


@dataclass(frozen=True, slots=True, kw_only=True)
class TlsFiles(Parameters):
    """Mutual TLS: files in PEM; the certificate's common name is the identity."""

    ca: FilePath = field(metadata={"description": "the authority that signed all certificates"})
    certificate: FilePath = field(metadata={"description": "this machine's"})
    private_key: FilePath = field(metadata={"description": "this machine's"})

    def absolute(self) -> "TlsFiles":
        """The same wherever they are read."""
        return TlsFiles(
            ca=self.ca.absolute(),
            certificate=self.certificate.absolute(),
            private_key=self.private_key.absolute(),
        )


def files_in(folder: Path, name: str) -> TlsFiles:
    """The files of the router or of an identity in a folder of `fleetloop certs`."""
    return TlsFiles(
        ca=folder / f"{AUTHORITY}{CERTIFICATE_SUFFIX}",
        certificate=folder / f"{name}{CERTIFICATE_SUFFIX}",
        private_key=folder / f"{name}{KEY_SUFFIX}",
    )


def common_name_of(identity: str, number: int) -> str:
    """The common name of an identity's certificate for its first, second, ... key."""
    return identity if number == 1 else f"{identity}{_NUMBER}{number}"


def identity_and_number(common_name: str) -> tuple[str, int]:
    """The identity that a common name proves, and for which of its keys, from 1."""
    identity, mark, number = common_name.rpartition(_NUMBER)
    if mark and identity and number.isascii() and number.isdecimal() and int(number) > 1:
        return identity, int(number)
    return common_name, 1
