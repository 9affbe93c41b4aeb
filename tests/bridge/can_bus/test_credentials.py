"""What a program on another machine gives to be let in."""

from pathlib import Path

import pytest
from can.util import load_config
from hypothesis import given
from hypothesis import strategies as st
from support.certificates import certificates

from bridge.can_bus.credentials import network_of
from bridge.can_bus.options import as_option
from configs.errors import ScenarioError
from configs.tls import TlsFiles

TCP = {"endpoint": "tcp/lab:7447", "user": "bench"}
TLS = {"endpoint": "tls/lab:7447", "user": "bench"}


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    certificates(tmp_path, ("bench", "boss"))
    made = {"ca": "ca.pem", "certificate": "bench.pem", "private_key": "bench.key"}
    return {name: str(tmp_path / file) for name, file in made.items()}


def users(folder: Path, text: str = "boss:x\nbench:a:b\n", mode: int = 0o600) -> str:
    path = folder / "users"
    path.write_text(text)
    path.chmod(mode)
    return str(path)


def test_a_password_goes_with_tcp_given_or_from_a_file(tmp_path: Path) -> None:
    assert network_of({**TCP, "password": "word"}).password == "word"
    found = network_of({**TCP, "users": users(tmp_path)})
    assert (found.user, found.password, found.tls) == ("bench", "a:b", None)


@given(st.one_of(st.from_regex(r"[-+0-9.eETruFals]{1,8}", fullmatch=True), st.text(min_size=1)))
def test_a_password_is_the_same_however_it_reaches_the_router(password: str) -> None:
    through_python_can = load_config(config={**TCP, "interface": "virtual", "password": password})
    given = as_option(password)
    assert as_option(through_python_can["password"]) == given
    assert network_of({**TCP, "password": given}).password == given


def test_a_password_that_looks_like_a_number_or_a_truth_value_is_one() -> None:
    for text, option in (("0123", "123"), ("1.50", "1.5"), ("true", "true"), ("s3cret", "s3cret")):
        assert as_option(text) == option
    assert as_option("9" * 5000) == "9" * 5000


def test_certificates_go_with_tls(files: dict[str, str]) -> None:
    assert network_of({**TLS, **files}).tls == TlsFiles(
        **{name: Path(file) for name, file in files.items()}
    )


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"endpoint": "tcp/lab:7447"}, "give endpoint and user"),
        ({**TCP, "endpoint": "lab:7447"}, r"'lab:7447': must be tcp/HOST:PORT or tls/HOST:PORT"),
        (TCP, "give either password or users"),
        ({**TCP, "password": "x", "users": "f"}, "give either password or users"),
        ({**TCP, "password": "x", "ca": "f"}, "ca doesn't go with tcp/lab:7447: give password"),
        ({**TLS, "password": "x"}, "password doesn't go with tls/lab:7447: give ca, certificate"),
        (TLS, r"ca = \(missing\)"),
    ],
)
def test_what_is_missing_or_does_not_go_together_is_named(
    options: dict[str, str], complaint: str
) -> None:
    with pytest.raises(ScenarioError, match=complaint):
        network_of(options)


def test_a_file_that_is_not_there_is_named(files: dict[str, str]) -> None:
    with pytest.raises(ScenarioError, match="private_key = /no/key: No such file"):
        network_of({**TLS, **files, "private_key": "/no/key"})


def test_a_file_of_passwords_is_ones_own_and_has_ones_line(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="others may read it; chmod 600"):
        network_of({**TCP, "users": users(tmp_path, mode=0o644)})
    with pytest.raises(ScenarioError, match="no line bench:<password>"):
        network_of({**TCP, "users": users(tmp_path, "boss:x\n")})


def test_blanks_around_identities_and_passwords_of_a_file_count_for_nothing(tmp_path: Path) -> None:
    file = users(tmp_path, " boss : two words \n\nbench:\t0123\r\n")
    assert network_of({**TCP, "users": file}).password == "123"
    assert network_of({**TCP, "user": "boss", "users": file}).password == "two words"
