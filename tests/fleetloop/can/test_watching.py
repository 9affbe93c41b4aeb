"""`list --watch`, with buses in this process."""

import json

from support.terminals import Screen, as_terminal

from fleetloop.can.watching import watch_buses


def test_elsewhere_than_on_a_terminal_one_listing_follows_the_other(buses, capsys) -> None:
    assert watch_buses(seconds=0.02, bit_rate=500_000, as_json=False, lasting_s=0.1) == 0
    out = capsys.readouterr().out
    assert out.count("run run") == out.count("load at 0.5 Mbit/s") >= 2
    assert "\x1b" not in out


def test_json_is_a_line_each(buses, capsys) -> None:
    assert watch_buses(seconds=0.02, bit_rate=500_000, as_json=True, lasting_s=0.1) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) >= 2
    assert [[report["bus"] for report in line] for line in lines] == [["r1", "r2"]] * len(lines)


def test_on_a_terminal_it_is_one_picture(buses, monkeypatch) -> None:
    screen = Screen()
    with as_terminal(monkeypatch, stdout=screen):
        assert watch_buses(seconds=0.02, bit_rate=500_000, as_json=False, lasting_s=0.1) == 0
    assert screen.getvalue().count("run run") >= 2
    assert "\x1b[1A\x1b[2K" in screen.getvalue()  # over the former one


def test_without_buses_it_goes_on(runtime_folder, capsys) -> None:
    assert watch_buses(seconds=0.02, bit_rate=500_000, as_json=False, lasting_s=0.1) == 0
    told = capsys.readouterr().out.splitlines()
    assert 2 <= told.count(told[0]) <= 12
    assert told[0].startswith("no bus is up in ")
