"""Requests to a run: one answer to each, whatever is in its line."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.errors import ScenarioError
from fleetloop.door.requests import Request, serve


def double(respond, number: int) -> None:
    respond({"number": 2 * number})


def refuse(respond) -> None:
    raise ScenarioError("not now")


REQUESTS = {"double": Request({"number": int}, double), "refuse": Request({}, refuse)}


def answered(line: bytes) -> dict:
    answers: list[dict] = []
    serve(line, REQUESTS, answers.append)
    (answer,) = answers
    return answer


def test_a_request_is_carried_out_and_its_id_comes_back() -> None:
    assert answered(b'{"request": "double", "number": 4, "id": [1]}') == {"number": 8, "id": [1]}
    assert answered(b'{"request": "double", "number": 4}') == {"number": 8}


def test_a_refusal_is_told_with_its_reason() -> None:
    assert answered(b'{"request": "refuse", "id": 1}') == {"error": "not now", "id": 1}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"", "not a line of JSON"),
        (b"\xff", "not a line of JSON"),
        (b"[" * 100_000, "not a line of JSON"),
        (b"[]", "must be an object"),
        (b'{"request": "triple"}', "'triple': no such request; known: double, refuse"),
        (b'{"request": ["double"]}', "no such request"),
        (b'{"request": "double"}', "double: takes number, not none"),
        (b'{"request": "double", "number": true}', "double: number must be of type int"),
        (b'{"request": "refuse", "number": 1}', "refuse: takes no arguments, not number"),
    ],
)
def test_what_is_no_request_is_told_why(line: bytes, said: str) -> None:
    assert said in answered(line)["error"]


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.text(max_size=9), st.lists))
def test_any_json_has_one_answer(value) -> None:
    assert "error" in answered(json.dumps({"request": value, "number": value}).encode())
