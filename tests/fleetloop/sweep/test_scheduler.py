"""What is wrong with a scheduler's address or its certificates is said before Dask connects."""

import re
import socket
from datetime import timedelta
from pathlib import Path

import dask
import distributed
import pytest
from cryptography import x509
from support.certificates import certificates, openssl, sign_for

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.sweep.scheduler import Tls, client_of_scheduler

TLS = "tls://127.0.0.1:1"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Certificates of one authority; `both.pem` has its key in it, `locked.key` a password."""
    folder = tmp_path_factory.mktemp("certificates")
    certificates(folder, ("me", "you"))
    (folder / "both.pem").write_text(
        (folder / "me.pem").read_text() + (folder / "me.key").read_text()
    )
    openssl(folder, "ec", "-in", "me.key", "-aes256", "-passout", "pass:word", "-out", "locked.key")
    openssl(folder, "genrsa", "-out", "rsa.key", "2048")
    (folder / "empty.pem").touch()
    (folder / "chain.pem").write_text(
        (folder / "me.pem").read_text() + (folder / "you.key").read_text()
    )
    return folder


def refusal(address: str, tls: Tls = Tls()) -> str:  # noqa: B008
    with pytest.raises(ScenarioError) as caught:
        client_of_scheduler(distributed, address, tls)
    return str(caught.value)


@pytest.mark.parametrize("address", ["head:8786", "tcp://head", "http://head:1", "tcp://head:x"])
def test_an_address_is_a_protocol_a_host_and_a_port(address: str) -> None:
    assert refusal(address).startswith(f"--scheduler {address}: must be tcp://HOST:PORT or tls://")


@pytest.mark.parametrize(
    ("names", "wrong"),
    [
        (("no.pem", "me.pem", "me.key"), "--tls-ca {}/no.pem: no such file"),
        (("ca.pem", "me.pem", "no.key"), "--tls-key {}/no.key: no such file"),
        (("me.key", "me.pem", "me.key"), "{}/me.key: must be an authority's certificate (PEM): "),
        (("ca.pem", "me.csr", "me.key"), "{0}/me.csr: must be a certificate (PEM), with its key"),
        (
            ("ca.pem", "me.pem", "you.key"),
            "--tls-key {0}/you.key: the key in it is not that of the certificate {0}/me.pem",
        ),
        (
            ("ca.pem", "me.pem", "rsa.key"),
            "--tls-key {0}/rsa.key: the key in it is not that of the certificate {0}/me.pem",
        ),
        (
            ("ca.pem", "chain.pem", None),
            "--tls-cert {0}/chain.pem: the key in it is not that of the certificate {0}/chain.pem",
        ),
        ((".", "me.pem", "me.key"), "--tls-ca {0}: a folder; must be a file (PEM)"),
        (("ca.pem", ".", "me.key"), "--tls-cert {0}: a folder; must be a file (PEM)"),
        (("ca.pem", "me.pem", "."), "--tls-key {0}: a folder; must be a file (PEM)"),
        (("empty.pem", "me.pem", "me.key"), "--tls-ca {0}/empty.pem: empty; must be a file in PEM"),
        (("ca.pem", "me.pem/x", "me.key"), "--tls-cert {0}/me.pem/x: can't be read: Not a dir"),
        (("ca.pem", "me.pem", "locked.key"), "in {}/locked.key: the key has a password"),
        (("ca.pem", "me.pem", None), "{}/me.pem: must be a certificate (PEM) and its key: "),
        (("ca.pem", None, None), f"--scheduler {TLS}: needs --tls-cert, and --tls-key for a key"),
        ((None, None, None), f"--scheduler {TLS}: needs --tls-ca and --tls-cert, and --tls-key"),
    ],
)
def test_a_file_that_tls_cannot_use_is_named(
    folder: Path, names: tuple[str | None, ...], wrong: str
) -> None:
    tls = Tls(*(name and folder / name for name in names))
    assert wrong.format(folder) in refusal(TLS, tls)


@pytest.mark.parametrize(
    ("begins", "ends", "said"),
    [
        (timedelta(days=-9), timedelta(days=-2), r"the certificate expired on {ends}; renew it"),
        (timedelta(days=2), timedelta(days=9), r"the certificate is not valid before {begins}; is"),
    ],
    ids=["expired", "not yet valid"],
)
def test_a_certificate_that_is_not_good_now_is_named_with_the_date(
    tmp_path: Path, begins: timedelta, ends: timedelta, said: str
) -> None:
    certificates(tmp_path, ("me",))
    sign_for(tmp_path, "me", begins=begins, ends=ends)
    made = x509.load_pem_x509_certificate((tmp_path / "me.pem").read_bytes())
    dates = {
        "begins": f"{made.not_valid_before_utc:%Y-%m-%d %H:%M} UTC",
        "ends": f"{made.not_valid_after_utc:%Y-%m-%d %H:%M} UTC",
    }
    tls = Tls(tmp_path / "ca.pem", tmp_path / "me.pem", tmp_path / "me.key")
    name = f"--tls-cert {tmp_path / 'me.pem'}: "
    assert refusal(TLS, tls).startswith(name + said.format(**dates))


def test_of_several_authorities_one_that_is_good_now_is_enough(tmp_path: Path) -> None:
    certificates(tmp_path, ("me", "next"))
    sign_for(tmp_path, "next", begins=timedelta(days=2), ends=timedelta(days=9))
    bundle = (tmp_path / "ca.pem").read_text() + (tmp_path / "next.pem").read_text()
    (tmp_path / "authorities.pem").write_text(bundle)
    tls = Tls(tmp_path / "authorities.pem", tmp_path / "me.pem", tmp_path / "me.key")
    with pytest.raises(InfrastructureError, match=re.escape(f"{TLS}: no scheduler there")):
        client_of_scheduler(distributed, TLS, tls)


def test_certificates_need_an_address_with_tls(folder: Path) -> None:
    said = refusal("tcp://127.0.0.1:1", Tls(ca=folder / "ca.pem"))
    assert said == (
        "--scheduler tcp://127.0.0.1:1: has no certificates; with --tls-ca it must be"
        " tls://HOST:PORT"
    )


def test_encryption_that_dasks_own_settings_require_is_kept() -> None:
    with dask.config.set({"distributed.comm.require-encryption": True}):
        assert "Dask's own settings require encryption" in refusal("tcp://127.0.0.1:1")


def test_files_that_are_right_get_as_far_as_the_scheduler(folder: Path) -> None:
    tls = Tls(folder / "ca.pem", folder / "both.pem")
    with pytest.raises(InfrastructureError, match=re.escape(f"{TLS}: no scheduler there")):
        client_of_scheduler(distributed, TLS, tls)


def test_files_of_dasks_own_settings_are_checked_the_same(folder: Path) -> None:
    own = {"distributed.comm.tls.ca-file": str(folder / "ca.pem")}
    with dask.config.set(own):
        assert "needs --tls-cert, and" in refusal(TLS)


@pytest.mark.timeout(60)
def test_who_answers_otherwise_is_no_scheduler() -> None:
    with socket.create_server(("127.0.0.1", 0)) as stranger:
        stranger.listen()
        address = f"tcp://127.0.0.1:{stranger.getsockname()[1]}"
        with pytest.raises(InfrastructureError, match="answers, but not as a Dask scheduler"):
            client_of_scheduler(distributed, address, Tls())
