"""A folder of certificates: what is in it, who may read it, and what is refused."""

import shutil
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID
from support.clocks import ManualClock

from bridge.network.tls import check_tls
from bridge.process.clock import SYSTEM_CLOCK
from configs.errors import ScenarioError
from configs.tls import files_in
from fleetloop.certificates.authority import BACKDATED, common_name, hosts_of
from fleetloop.certificates.folder import CertificateFolder

DAY_NS = 86_400 * 10**9


def folder(path: Path, days_ago: int = 0, **days: int) -> CertificateFolder:
    """A folder made so long ago; its clock goes on from there."""
    made = CertificateFolder(path, clock=at(days_ago))
    made.create(["localhost", "127.0.0.1", "::1"], **{"days": 30, "authority_days": 300} | days)
    return made


def at(days_ago: int) -> ManualClock:
    return ManualClock(SYSTEM_CLOCK.wall_ns() - days_ago * DAY_NS)


@pytest.fixture
def made(tmp_path: Path) -> CertificateFolder:
    return folder(tmp_path / "certs")


def openssl(*args: object) -> str:
    return subprocess.run(
        ["openssl", *map(str, args)], capture_output=True, text=True, check=True, timeout=60
    ).stdout


def test_openssl_verifies_each_chain_for_its_own_purpose_only(made: CertificateFolder) -> None:
    made.issue("agent-r1", days=30)
    path = made.path
    verify = ("verify", "-x509_strict", "-CAfile", path / "ca.pem", "-purpose")
    for host in ("localhost", "127.0.0.1", "::1"):
        flag = "-verify_hostname" if host == "localhost" else "-verify_ip"
        assert "OK" in openssl(*verify, "sslserver", flag, host, path / "router.pem")
    assert "OK" in openssl(*verify, "sslclient", path / "agent-r1.pem")
    for purpose, name in (("sslserver", "agent-r1"), ("sslclient", "router")):
        with pytest.raises(subprocess.CalledProcessError):
            openssl(*verify, purpose, path / f"{name}.pem")


def test_a_certificate_says_what_it_is_for_and_how_long(made: CertificateFolder) -> None:
    one = made.issue("agent-r1", days=30)
    assert common_name(one) == "agent-r1"
    assert isinstance(one.public_key(), ec.EllipticCurvePublicKey)
    assert one.public_key().curve.name == "secp256r1"
    lasts = one.not_valid_after_utc - one.not_valid_before_utc
    assert timedelta() <= timedelta(days=30) + BACKDATED - lasts <= timedelta(seconds=2)
    usage = one.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert hosts_of(made.certificate("router")) == ["localhost", "127.0.0.1", "::1"]


def test_no_certificate_outlives_its_authority(made: CertificateFolder) -> None:
    ca = x509.load_pem_x509_certificate((made.path / "ca.pem").read_bytes())
    assert made.issue("plant", days=3000).not_valid_after_utc == ca.not_valid_after_utc


def test_keys_are_for_their_owner_alone(made: CertificateFolder) -> None:
    made.issue("agent-r1", days=30)
    modes = {file.name: file.stat().st_mode & 0o777 for file in made.path.iterdir()}
    assert {name for name in modes if name.endswith(".key")} == {
        "ca.key",
        "router.key",
        "agent-r1.key",
    }
    assert all(modes[name] == 0o600 for name in modes if name.endswith(".key"))
    assert made.path.stat().st_mode & 0o777 == 0o700


def test_its_files_pass_the_check_before_a_connection(made: CertificateFolder) -> None:
    made.issue("agent-r1", days=30)
    assert check_tls(files_in(made.path, "agent-r1"), "agent-r1") == "agent-r1"
    assert check_tls(files_in(made.path, "router"), None, host="localhost") == "router"
    with pytest.raises(ScenarioError, match="not valid for 'elsewhere'"):
        check_tls(files_in(made.path, "router"), None, host="elsewhere")


def test_no_robot_can_pass_for_the_router(made: CertificateFolder) -> None:
    made.issue("agent-r1", days=30)
    with pytest.raises(ScenarioError, match="unsuitable certificate purpose"):
        check_tls(files_in(made.path, "agent-r1"), None)


def test_renewing_keeps_the_key_and_does_not_need_it(made: CertificateFolder) -> None:
    old = made.issue("agent-r1", days=30)
    (made.path / "agent-r1.key").unlink()  # it is on the robot
    new = made.renew("agent-r1", days=60)
    assert new.public_key() == old.public_key()
    assert new.not_valid_after_utc > old.not_valid_after_utc
    assert made.proved_name("agent-r1") == "agent-r1"
    assert hosts_of(made.renew("router", days=30, hosts=["base.local"])) == ["base.local"]
    assert hosts_of(made.renew("router", days=30)) == ["base.local"]


def test_a_revoked_identity_comes_back_with_another_key_and_common_name(
    made: CertificateFolder,
) -> None:
    made.issue("agent-r1", days=30)
    renewed = made.renew("agent-r1", days=30)
    gone = made.revoke("agent-r1")
    assert len(gone) == 2 and renewed in gone
    with pytest.raises(ScenarioError, match=r"agent-r1\.pem: is revoked; `fleetloop certs robot"):
        made.proved_name("agent-r1")
    again = made.issue("agent-r1", days=30)
    assert again.public_key() != renewed.public_key()
    assert made.proved_name("agent-r1") == "agent-r1#2"
    assert check_tls(files_in(made.path, "agent-r1"), "agent-r1") == "agent-r1#2"
    listed = x509.load_pem_x509_crl((made.path / "crl.pem").read_bytes())
    assert {it.serial_number for it in listed} == {it.serial_number for it in gone}
    assert "verify OK" in openssl_crl(made.path)


def openssl_crl(path: Path) -> str:
    done = subprocess.run(
        ["openssl", "crl", "-in", path / "crl.pem", "-CAfile", path / "ca.pem", "-noout"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    return done.stdout + done.stderr


def test_a_name_is_never_used_for_two_keys_even_if_its_file_was_deleted(
    made: CertificateFolder,
) -> None:
    made.issue("agent-r1", days=30)
    made.revoke("agent-r1")
    (made.path / "agent-r1.pem").unlink()
    assert common_name(made.issue("agent-r1", days=30)) == "agent-r1#2"


def test_an_expired_certificate_is_named_with_its_date_and_remedy(tmp_path: Path) -> None:
    old = folder(tmp_path / "certs", days_ago=40)
    old.issue("agent-r1", days=30)
    today = CertificateFolder(tmp_path / "certs")
    day = datetime.fromtimestamp(SYSTEM_CLOCK.wall_ns() * 1e-9, UTC) - timedelta(days=10)
    with pytest.raises(ScenarioError, match=rf"agent-r1\.pem: has expired, on {day:%Y-%m-%d}"):
        today.proved_name("agent-r1")
    today.renew("agent-r1", days=30)
    assert today.proved_name("agent-r1") == "agent-r1"
    with pytest.raises(ScenarioError, match=r"router\.pem.*: certificate has expired"):
        check_tls(files_in(tmp_path / "certs", "router"), None)


def test_no_two_certificates_end_at_one_second_and_that_tells_whose_one_is(
    made: CertificateFolder,
) -> None:
    ends = {
        int(made.issue(f"agent-r{n}", days=30).not_valid_after_utc.timestamp()): f"agent-r{n}"
        for n in range(5)
    }
    assert len(ends) == 5
    assert ends.items() <= made.expiries().items()


def test_an_expired_authority_makes_no_more_certificates(tmp_path: Path) -> None:
    folder(tmp_path / "certs", days_ago=40, authority_days=39).issue("agent-r1", days=30)
    today = CertificateFolder(tmp_path / "certs")
    for act in (lambda: today.issue("plant", days=1), lambda: today.proved_name("agent-r1")):
        with pytest.raises(ScenarioError, match=r"ca\.pem: .*has expired, .*fleetloop certs init"):
            act()


def test_a_certificate_of_another_authority_is_named(made: CertificateFolder, tmp_path) -> None:
    other = folder(tmp_path / "other")
    other.issue("agent-r1", days=30)
    for suffix in (".pem", ".key"):
        shutil.copy(other.path / f"agent-r1{suffix}", made.path)
    with pytest.raises(ScenarioError, match=r"agent-r1\.pem: is not signed by .*certs/ca\.pem"):
        made.proved_name("agent-r1")
    with pytest.raises(ScenarioError, match=r"agent-r1\.pem: by ca = "):
        check_tls(files_in(made.path, "agent-r1"), "agent-r1")
    shutil.copy(other.path / "crl.pem", made.path)
    with pytest.raises(ScenarioError, match=r"crl\.pem: is not signed by"):
        made.is_revoked(made.certificate("router"))
    shutil.copy(other.path / "ca.key", made.path)
    with pytest.raises(ScenarioError, match=r"ca\.key: is not the key of"):
        made.issue("plant", days=30)


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").touch()
    with pytest.raises(ScenarioError, match="exists already; name a new folder"):
        CertificateFolder(tmp_path).create(["x"], days=1, authority_days=1)
    assert [file.name for file in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize(
    ("identity", "guest", "said"),
    [
        ("r1", False, r"r1: no identity of a run \(agent-r1 is a robot's\); known: agent-<robot>"),
        ("agent-", False, "agent-: no identity of a run; known"),
        ("router", False, "router: no identity"),
        ("../x", False, "no identity"),
        ("plant", True, "plant: can't be a guest's name"),
        ("ca", True, "ca: can't be a guest's name"),
        ("agent-r1", False, r"agent-r1\.pem: exists already; `fleetloop certs renew`"),
    ],
)
def test_who_can_not_have_a_certificate_is_told_why(
    made: CertificateFolder, identity: str, guest: bool, said: str
) -> None:
    made.issue("agent-r1", days=30)
    made.issue("bench", days=30, guest=True)
    with pytest.raises(ScenarioError, match=said):
        made.issue(identity, days=30, guest=guest)


def test_what_can_not_be_renewed_or_revoked_is_told_why(made: CertificateFolder) -> None:
    made.issue("agent-r1", days=30)
    for act, said in (
        (
            lambda: made.renew("agent-r9", days=1),
            r"agent-r9: no certificate in .*: agent-r1, route",
        ),
        (lambda: made.revoke("agent-r9"), "agent-r9: no certificate in"),
        (lambda: made.renew("agent-r1", days=1, hosts=["x"]), "--host: is for the router's"),
        (lambda: made.revoke("router"), "Zenoh's clients read no list of what is revoked"),
    ):
        with pytest.raises(ScenarioError, match=said):
            act()
    made.revoke("agent-r1")
    with pytest.raises(ScenarioError, match="is revoked already"):
        made.revoke("agent-r1")
    with pytest.raises(ScenarioError, match="is revoked; `fleetloop certs robot` makes a new key"):
        made.renew("agent-r1", days=1)


def test_where_the_authority_is_not_nothing_can_be_made(made: CertificateFolder, tmp_path) -> None:
    made.issue("agent-r1", days=30)
    with pytest.raises(ScenarioError, match=r"no folder of `fleetloop certs` \(ca\.pem is not"):
        CertificateFolder(tmp_path / "nowhere").issue("plant", days=1)
    (made.path / "ca.key").chmod(0o640)
    with pytest.raises(ScenarioError, match=r"ca\.key: others may read it; chmod 600"):
        made.issue("plant", days=30)
    (made.path / "ca.key").unlink()
    with pytest.raises(ScenarioError, match=r"ca\.key: not here; only where it is"):
        made.issue("plant", days=30)
    assert made.proved_name("agent-r1") == "agent-r1"  # a run needs no more


@pytest.mark.parametrize("host", ["", "a b", "http://x", "tls/base:7447", "-x"])
def test_a_host_that_is_none_is_refused_before_anything_is_written(host: str, tmp_path) -> None:
    with pytest.raises(ScenarioError, match="--host"):
        CertificateFolder(tmp_path / "c").create([host], days=1, authority_days=1)
    assert not (tmp_path / "c").exists()
