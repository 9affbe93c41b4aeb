"""Certificates by openssl: an authority, and whom it vouches for."""

import subprocess
from pathlib import Path

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
