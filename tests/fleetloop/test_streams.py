"""Standard streams that are closed, not in UTF-8, full or read by nobody; Ctrl-C before work."""

import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fleetloop import streams

IN_PROCESS = (
    "run",
    "two_robots",
    "--in-process",
    "--no-report",
    "--duration=0.2",
    "--allow-unchecked",
)


def fleetloop(*args: str, cwd: Path, shell: str = "", **env: str) -> subprocess.CompletedProcess:
    """Run it; `shell` is a redirection as a shell spells it."""
    return subprocess.run(
        ["sh", "-c", f'exec "$@" {shell}', "sh", sys.executable, "-m", "fleetloop", *args],
        cwd=cwd,
        capture_output=True,
        timeout=60,
        env=os.environ | {"PYTHONSAFEPATH": "1", "COLUMNS": "120"} | env,
    )


@pytest.mark.parametrize(
    ("text", "encoding", "shown"),
    [
        ("τ [N·m], 2.5 × real time", "latin-1", "tau [N·m], 2.5 × real time"),
        ("p²/q ≥ 4 → θ̂, Δ", "ascii", "p^2/q >= 4 -> theta_hat, Delta"),
        ("v̂_r → v_r, v̄_d, ṡ > 0", "ascii", "v_hat_r -> v_r, v_bar_d, s_dot > 0"),
        ("no such bus '\udcff'", "utf-8", "no such bus '?'"),
        ("…−√°µ漢", "ascii", "...-sqrtdegu?"),
    ],
)
def test_what_an_encoding_lacks_is_spelled_in_ascii(text: str, encoding: str, shown: str) -> None:
    streams.register()
    assert text.encode(encoding, streams.PLAIN).decode(encoding) == shown


@pytest.mark.parametrize(
    "env",
    [
        {"PYTHONIOENCODING": "latin-1"},
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_a_terminal_without_unicode_shows_everything(env: dict[str, str], tmp_path: Path) -> None:
    done = fleetloop("check", "two_robots", cwd=tmp_path, **env)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"v_hat_r -> v_r" in done.stdout
    done = fleetloop(*IN_PROCESS, cwd=tmp_path, **env)
    assert done.returncode == 0, done.stderr
    assert b"theta_e [rad]" in done.stdout


def test_json_is_json_where_there_is_no_unicode(tmp_path: Path) -> None:
    done = fleetloop("check", "--json", "two_robots", cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert json.loads(done.stdout)


@pytest.mark.parametrize("closed", ["2>&-", ">&-", ">&- 2>&-", "<&-", "<&- >&- 2>&-"])
def test_closed_streams_change_nothing_but_what_is_seen(closed: str, tmp_path: Path) -> None:
    done = fleetloop(*IN_PROCESS, "--out=run", cwd=tmp_path, shell=closed)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "summary.json").exists()


@pytest.mark.system
def test_processes_of_a_run_do_without_streams_too(tmp_path: Path) -> None:
    verb = [arg for arg in IN_PROCESS if arg != "--in-process"]
    done = fleetloop(*verb, "--out=run", cwd=tmp_path, shell="<&- >&- 2>&-")
    assert done.returncode == 0
    assert (tmp_path / "run" / "summary.json").exists()


@pytest.mark.system
def test_zenohs_log_goes_to_standard_error_that_of_the_roles_too(tmp_path: Path) -> None:
    verb = [arg for arg in IN_PROCESS if arg != "--in-process"]
    done = fleetloop(*verb, "--json", "--out=run", cwd=tmp_path, RUST_LOG="info")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["scenario"] == "two_robots"
    zenohs = [line for line in done.stderr.splitlines() if b"Using ZID" in line]
    assert len(zenohs) == 5  # launcher, plant, recorder, two controllers


@pytest.mark.parametrize(
    "args", [IN_PROCESS, ("check", "two_robots"), ("check", "two_robots", "--json")]
)
def test_a_reader_that_left_is_no_failure(args: tuple[str, ...], tmp_path: Path) -> None:
    unread, output = os.pipe()
    os.close(unread)
    done = subprocess.run(
        [sys.executable, "-m", "fleetloop", *args],
        cwd=tmp_path,
        stdout=output,
        stderr=subprocess.PIPE,
        timeout=60,
        env=os.environ | {"PYTHONSAFEPATH": "1"},
    )
    os.close(output)
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr
    assert b"Broken" not in done.stderr


def test_results_that_can_not_be_written_end_with_3_and_a_line(tmp_path: Path) -> None:
    done = fleetloop("check", "two_robots", cwd=tmp_path, shell=">/dev/full")
    assert done.returncode == 3
    assert done.stderr.decode().splitlines() == [
        "fleetloop: can't write the results to standard output: No space left on device"
    ]


def test_notes_that_can_not_be_written_are_lost(tmp_path: Path) -> None:
    done = fleetloop(*IN_PROCESS, "--out=run", cwd=tmp_path, shell="2>/dev/full")
    assert done.returncode == 0
    assert b"verdict" in done.stdout


def test_a_terminal_that_goes_away_does_not_end_a_run(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "fleetloop", *IN_PROCESS, "--duration=1.0", "--out=run"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env=os.environ | {"PYTHONSAFEPATH": "1", "TERM": "xterm"},
        start_new_session=True,
    )
    os.close(theirs)
    assert os.read(ours, 1)  # the progress bar moves
    os.close(ours)
    assert process.wait(60) == 0
    assert (tmp_path / "run" / "summary.json").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_imports_ends_it_in_silence(number: signal.Signals, tmp_path: Path) -> None:
    stuck = "print('importing', flush=True)\nimport time\ntime.sleep(60)\n"
    (tmp_path / "typer.py").write_text(stuck)
    process = subprocess.Popen(
        ["env", "--default-signal=INT", sys.executable, "-m", "fleetloop", "check"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"importing\n"
    process.send_signal(number)
    assert process.communicate(timeout=30) == (b"", b"")
    assert process.returncode == 130
