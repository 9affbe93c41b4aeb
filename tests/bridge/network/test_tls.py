"""Files of mutual TLS: what is wrong with them is said before anybody connects."""

from dataclasses import replace
from pathlib import Path

import pytest
from support.certificates import certificates

from bridge.network.tls import check_tls
from configs.errors import ScenarioError
from configs.tls import TlsFiles


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("certificates")
    certificates(made, ("router", "agent-r1", "agent-r2"))
    certificates(made, ("stranger",), authority="other")
    certificates(made, ("late",), days=-1)
    (made / "empty").touch()
    return made


def files(folder: Path, name: str) -> TlsFiles:
    return TlsFiles(
        ca=folder / "ca.pem",
        certificate=folder / f"{name}.pem",
        private_key=folder / f"{name}.key",
    )


def test_a_certificate_proves_whom_it_names_and_the_routers_may_have_any_name(folder: Path) -> None:
    check_tls(files(folder, "agent-r2"), "agent-r2")
    check_tls(files(folder, "router"), None)


def test_a_certificate_of_somebody_else_is_refused_with_both_names(folder: Path) -> None:
    with pytest.raises(ScenarioError, match=r"'agent-r1' \(its common name\), not of 'agent-r2'"):
        check_tls(files(folder, "agent-r1"), "agent-r2", "network.tls.")


@pytest.mark.parametrize("key", ["ca", "certificate", "private_key"])
@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("nothing.pem", "No such file or directory"),
        ("", "Is a directory"),
        ("empty", "no (certificate|private key) in PEM"),
    ],
)
def test_a_file_that_is_not_there_or_not_one_is_named_with_its_key(
    folder: Path, key: str, file: str, said: str
) -> None:
    wrong = replace(files(folder, "agent-r2"), **{key: folder / file})
    with pytest.raises(ScenarioError, match=f"^network.tls.{key} = {folder}/?{file}: {said}"):
        check_tls(wrong, "agent-r2", "network.tls.")


@pytest.mark.parametrize(
    ("name", "said"),
    [("stranger", "unable to get local issuer"), ("late", "certificate has expired")],
)
@pytest.mark.parametrize("listens", [False, True])
def test_a_certificate_that_the_other_end_would_refuse_is_refused_here(
    folder: Path, name: str, said: str, listens: bool
) -> None:
    with pytest.raises(ScenarioError, match=f"{name}.pem: by ca = .*: {said}"):
        check_tls(files(folder, name), None if listens else name)


def test_a_key_of_another_certificate_is_refused(folder: Path) -> None:
    mixed = replace(files(folder, "agent-r2"), private_key=folder / "agent-r1.key")
    with pytest.raises(ScenarioError, match=r"agent-r1\.key: key values mismatch"):
        check_tls(mixed, "agent-r2")


def test_an_encrypted_key_is_refused_and_nobody_is_asked_for_its_word(folder: Path) -> None:
    locked = folder / "locked.key"
    locked.write_text("-----BEGIN ENCRYPTED PRIVATE KEY-----\n")
    with pytest.raises(ScenarioError, match=r"locked\.key: is encrypted"):
        check_tls(replace(files(folder, "agent-r2"), private_key=locked), "agent-r2")
