"""A law, a path shape and an offset in files of the user's own: those of docs/own-laws.md.

Nothing is installed: the files are beside the scenario, and processes import them from there.
"""

import html
from pathlib import Path

import numpy as np
import pytest
from support.command_line import fleetloop
from support.own_files import FILES, replaced, write_own_files
from support.processes import completed

from fleetloop.record.reader import Record

pytestmark = pytest.mark.system
IN_PROCESS = ("--in-process",)
QUICK = ("--duration", "1", "--allow-unchecked", "--no-report")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """The folder of the page's files."""
    write_own_files(tmp_path)
    return tmp_path


def test_the_page_holds_what_it_expects(own: Path) -> None:
    done = fleetloop(own, "run", "own.toml", *IN_PROCESS, "--no-report", "--out", "a")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "held         distance_m of r1, r2" in done.stdout


def test_processes_import_the_files_and_leave_the_same_record(own: Path) -> None:
    scenario = str(own / "own.toml")
    assert completed(own / "a", scenario, "--in-process", *QUICK)[0] == 0
    assert completed(own / "b", scenario, *QUICK)[0] == 0
    done = fleetloop(own, "diff", "a", "b")
    assert (done.returncode, done.stdout.partition(":")[0]) == (0, "identical"), done.stdout


def test_a_record_is_read_without_the_files(own: Path) -> None:
    assert completed(own / "a", str(own / "own.toml"), "--in-process", *QUICK)[0] == 0
    for name in FILES:
        (own / name).unlink()
    assert fleetloop(own, "report", "a").returncode == 0
    assert (own / "a/figures/law_signals.png").is_file()
    assert "robots' laws record of themselves" in html.unescape((own / "a/report.html").read_text())
    assert fleetloop(own, "diff", "a", "a").returncode == 0
    done = fleetloop(own, "export", "a", "a.npz", "--signals", "distance_m,x_e_m,y_e_m,kappa_hat")
    assert done.returncode == 0, done.stderr
    table = np.load(own / "a.npz")
    r1, r3 = (table["robot"] == robot for robot in ("r1", "r3"))
    off = np.hypot(table["x_e_m"][r1], table["y_e_m"][r1])
    assert np.allclose(table["distance_m"][r1], off, rtol=0.0, atol=1e-12)
    assert np.isnan(table["distance_m"][r3]).all()
    assert np.isnan(table["kappa_hat"][r1]).all()
    assert np.isfinite(table["kappa_hat"][r3]).all()
    assert "distance_m" in (Record.open(own / "a/record.mcap").controller["r1"].dtype.names or ())


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("own.toml", "k_x_1_s", "k_z_1_s", "control.k_z_1_s = 2.5: unknown key; did you mean k_"),
        ("own.toml", "k_x_1_s = 2.5", "k_x_1_s = -1", "k_x_1_s = -1: must be greater than 0"),
        ("own.toml", "b_m = 2.5", "b_m = 'x'", 'own.toml: path.b_m = "x": must be a number'),
        ("own.toml", "left_m = 0.8", "lef = 1.0", "robot.r2.offset.left_m = (missing): must be"),
        ("own.toml", "my_law:Unicycle", "my_law:Bicycle", "my_law.py has no Bicycle; it has"),
        ("own.toml", "my_law:Unicycle", "no_law:Unicycle", "no no_law.py in"),
        ("own.toml", "my_law:Unicycle", "unicycl", 'control.law = "unicycl": no such law'),
        ("own.toml", "my_shapes:Ellipse", "my_shapes:cos", "my_shapes.py: cos is no path shape"),
        ("own.toml", 'signal = "distance_m"', 'signal = "distanc_m"', "did you mean distance_m?"),
        (
            "own.toml",
            '"adaptive_dsc_robust"',
            '"fixed_dsc", k5 = 1',
            "robot.r3.control.k5 = 1: un",
        ),
        ("own.toml", '"r1", "r2"]', '"r1", "r3"]', 'signal = "distance_m": no such signal'),
        ("my_law.py", "import cos, hypot", "import coz, hypot", "my_law.py, line 4: ImportError"),
        ("my_law.py", "class State", "class class", ": invalid syntax"),
        ("my_law.py", "class Unicycle(Law)", "class Unicycle", "it has no hold"),
        ("my_law.py", "def step(", "def stepp(", "Unicycle is no law: it has no step (see"),
        (
            "my_law.py",
            "parameter(0.2,",
            "parameter(-0.2,",
            "my_law.py: Unicycle.Gains: the default of k_i_1_s2 is -0.2, which must be 0 or more",
        ),
        (
            "my_shapes.py",
            "a_m: Positive = parameter(3.0",
            "a_m: Positive = parameter(-3.0",
            "my_shapes.py: Ellipse: the default of a_m is -3.0, which must be greater than 0",
        ),
        ("my_law.py", '"distance_m"', '"x_m"', "SIGNALS: x_m is recorded of every robot already"),
        ("my_law.py", "k_v_N_m_s: Positive", "law: Positive", "law is the key that names the law"),
    ],
)
def test_what_is_wrong_is_said_before_the_run(
    own: Path, name: str, old: str, new: str, said: str
) -> None:
    if new == "class Unicycle":  # what it would have from Law
        replaced(own, name, "    def hold", "    def held")
    replaced(own, name, old, new)
    done = fleetloop(own, "run", "own.toml", "--in-process", *QUICK)
    assert done.returncode == 2, done.stdout + done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("own.toml", "my_law:Unicycle", "my_law:Bicycle"),
        ("own.toml", "my_law:Unicycle", "no_law:Unicycle"),
        ("my_law.py", "class State", "class class"),
    ],
)
def test_a_robots_gains_are_not_judged_by_the_default_law_when_the_fleets_is_lost(
    own: Path, name: str, old: str, new: str
) -> None:
    replaced(own, "own.toml", '"r2"\n', '"r2"\ncontrol = { k_i_1_s2 = 0.4 }\n')
    replaced(own, "own.toml", '"adaptive_dsc_robust"', '"adaptive_dsc_robust", k55 = 1')
    replaced(own, name, old, new)
    done = fleetloop(own, "check", "own.toml")
    assert done.returncode == 2
    assert "own.toml: control.law = " in done.stderr
    assert "k_i_1_s2" not in done.stderr
    assert "robot.r3.control.k55 = 1: unknown key" in done.stderr  # r3 names its own law


@pytest.mark.parametrize(
    ("mode", "new", "said"),
    [
        ((), "(hypot(dx, dy),) if along.s < 0.01 else dx[0]", ": TypeError: 'float'"),
        (
            IN_PROCESS,
            "(hypot(dx, dy),) if along.s < 0.01 else ()",
            "step returned 0 signals, SIGNALS has 1",
        ),
        (
            IN_PROCESS,
            "(hypot(dx, dy),)) if along.s < 0.01 else (1, 2",
            "step must return (tau_right",
        ),
        (
            IN_PROCESS,
            "(hypot(dx, dy) / (along.s < 0.01),)",
            "ZeroDivisionError: float division by zero",
        ),
    ],
)
def test_a_law_that_fails_stops_its_own_robots_and_no_other(
    own: Path, mode: tuple[str, ...], new: str, said: str
) -> None:
    replaced(own, "my_law.py", "(hypot(dx, dy),)", new)
    done = fleetloop(own, "run", "own.toml", "--force", "--out", "a", *mode, *QUICK)
    assert "STOPPED r1" in done.stdout
    told = " ".join(done.stdout.split())
    assert said in told
    assert "law my_law:Unicycle failed at s = 0.01" in told
    assert "diverged" not in told
    assert "STOPPED r3" not in done.stdout
    record = Record.open(own / "a/record.mcap")
    assert len(record.controller["r1"]) == len(record.controller["r3"]) == 1000


@pytest.mark.parametrize("where", ["dx, dy = ", "self.gains, self."])
def test_a_law_that_exits_has_failed_and_ends_no_check(own: Path, where: str) -> None:
    replaced(own, "my_law.py", where, "import sys\n        sys.exit(3)\n        " + where)
    done = fleetloop(own, "check", "own.toml")
    assert done.returncode in (1, 2)
    assert "SystemExit: 3" in " ".join((done.stdout + done.stderr).split())
    assert "Traceback" not in done.stderr


def test_a_torque_in_a_text_is_no_number(own: Path) -> None:
    replaced(own, "my_law.py", "LawOutput(push + turn", "LawOutput(str(push + turn)")
    done = fleetloop(own, "check", "own.toml")
    assert done.returncode == 1
    assert "step must return (tau_right, tau_left, state," in " ".join(done.stdout.split())


def test_a_law_that_asks_for_no_number_stops_its_robot(own: Path) -> None:
    replaced(own, "my_law.py", "LawOutput(push + turn", "LawOutput(float('nan')")
    done = fleetloop(own, "run", "own.toml", "--force", "--in-process", *QUICK)
    assert "torque that is not finite" in done.stdout


OFF, PATH = "return (0.0, 0.0, 0.0, 0.0), (l + l", "return (\n            (a * c, -a"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (OFF, "1 / 0\n        " + OFF, "Breathing: {}, line 31: ZeroDivisionError: division by"),
        (OFF, OFF.replace("(l", "(1e999 * l"), "Breathing: {}: jet(0) is not finite: it returned"),
        (PATH, PATH.replace("(a", "(float('nan') * a"), "Ellipse: {}: jet(0) is not finite"),
        (PATH, "return None\n        " + PATH, "Ellipse: {}: jet must return ((x, x', x'', x'''),"),
        (PATH, "return c, n\n        " + PATH, "numbers; it returned (1.0, 0.0)"),
        (PATH, 'return "1234", "1234"\n        ' + PATH, "numbers; it returned ('1234', '1234')"),
    ],
)
def test_a_shape_that_gives_no_jet_is_named_with_its_file(
    own: Path, old: str, new: str, said: str
) -> None:
    replaced(own, "my_shapes.py", old, new)
    done = fleetloop(own, "check", "own.toml")
    assert done.returncode == 2, done.stdout + done.stderr
    assert said.format(own / "my_shapes.py") in " ".join(done.stderr.split())
    assert " at s = 0 m" in done.stderr
    assert "curvature" not in done.stderr
    assert "Traceback" not in done.stderr


def test_a_shape_that_fails_in_a_run_stops_its_robot_and_is_named(own: Path) -> None:
    run_only = (
        'import sys\n        if "fleetloop.check" not in sys.modules:\n            1 / 0\n        '
    )
    replaced(own, "my_shapes.py", OFF, run_only + OFF)
    done = fleetloop(own, "run", "own.toml", "--force", "--out", "a", *QUICK)
    said = " ".join(done.stdout.split())
    assert "STOPPED r2" in said
    assert "the path failed at s = 0 m: formation offset my_shapes:Breathing: " in said
    assert "STOPPED r1" not in said
