"""Section [network.tls] of a deployment, which processes receive as it is."""

from dataclasses import dataclass, field

from configs.parameters import FilePath, Parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class TlsFiles(Parameters):
    """Mutual TLS: files in PEM; the certificate's common name is the identity."""

    ca: FilePath = field(metadata={"description": "the authority that signed all certificates"})
    certificate: FilePath = field(metadata={"description": "this machine's"})
    private_key: FilePath = field(metadata={"description": "this machine's"})
