"""Certificates by openssl: an authority, and whom it vouches for."""

import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization

from bridge.process.clock import SYSTEM_CLOCK

CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")


def openssl(folder: Path, *args: str) -> None:
    subprocess.run(["openssl", *args], check=True, capture_output=True, cwd=folder, timeout=60)


def certificates(
    folder: Path, names: tuple[str, ...], *, authority: str = "ca", days: int = 2
) -> None:
    """An authority `ca` and a certificate signed by it for each name, in PEM."""
    made = (
        "-keyout",
        f"{authority}.key",
        "-out",
        f"{authority}.pem",
        "-subj",
        f"/CN=fleet of {authority}",
    )
    if not (folder / f"{authority}.pem").exists():
        openssl(folder, "req", "-x509", *CURVE, *made, "-days", "2")
    (folder / "ext").write_text("subjectAltName=DNS:localhost\n")
    for name in names:
        request = ("-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}")
        openssl(folder, "req", *CURVE, *request)
        sign = ("-CA", f"{authority}.pem", "-CAkey", f"{authority}.key", "-CAcreateserial")
        what = ("-in", f"{name}.csr", "-out", f"{name}.pem", "-extfile", "ext", "-days", f"{days}")
        openssl(folder, "x509", "-req", *what, *sign)


def sign_for(folder: Path, name: str, *, begins: timedelta, ends: timedelta) -> None:
    """Sign the certificate of a name anew, valid between these times from now."""
    now = datetime.fromtimestamp(SYSTEM_CLOCK.wall_ns() // 10**9, UTC)
    old = x509.load_pem_x509_certificate((folder / f"{name}.pem").read_bytes())
    key = serialization.load_pem_private_key((folder / "ca.key").read_bytes(), None)
    builder = (
        x509.CertificateBuilder()
        .subject_name(old.subject)
        .issuer_name(old.issuer)
        .public_key(old.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now + begins)
        .not_valid_after(now + ends)
    )
    signed = builder.sign(key, hashes.SHA256())  # type: ignore[arg-type]
    (folder / f"{name}.pem").write_bytes(signed.public_bytes(serialization.Encoding.PEM))
