"""Figures that a process beside writes: the same files, and its errors are told."""

import io
import os
import pickle
import signal
from pathlib import Path

import psutil
import pytest
from matplotlib.figure import Figure

from configs.errors import InfrastructureError
from fleetloop.results.pictures import lay_out, picture
from fleetloop.results.printer import FORMATS, Printer, serve

pytestmark = pytest.mark.timeout(60)


@pytest.fixture
def figure() -> Figure:
    figure = Figure(figsize=(3.0, 2.0), layout="constrained")
    figure.subplots().plot([0.0, 1.0], [0.0, 2.0], label="θ_e [rad]")
    lay_out(figure)
    return figure


def test_the_files_are_those_of_this_process(tmp_path: Path, figure: Figure) -> None:
    serve(tmp_path, io.BytesIO(pickle.dumps(("here", figure))))
    with Printer(tmp_path) as printer:
        printer.print("beside", figure)
        printer.print("again", figure)
    assert len(list(tmp_path.iterdir())) == 3 * len(FORMATS)
    for form in FORMATS:
        here, beside, again = (
            (tmp_path / f"{name}.{form}").read_bytes() for name in ("here", "beside", "again")
        )
        assert here == beside == again


def test_each_format_is_what_its_name_says(figure: Figure) -> None:
    assert picture(figure, "pdf").startswith(b"%PDF-")
    assert b"<svg " in picture(figure, "svg")
    assert picture(figure, "png").startswith(b"\x89PNG")


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path, figure: Figure) -> None:
    gone = tmp_path / "gone"
    with (
        pytest.raises(InfrastructureError, match=rf"can't write {gone}/x.svg: No such file"),
        Printer(gone) as printer,
    ):
        printer.print("x", figure)
        for _ in range(100):  # it ends early: what comes later is not waited for
            printer.print("y", figure)


def test_its_end_before_time_is_told(tmp_path: Path) -> None:
    before = psutil.Process().children()
    with (
        pytest.raises(InfrastructureError, match="SVG and PDF files ended with -9"),
        Printer(tmp_path),
    ):
        (child,) = (one for one in psutil.Process().children() if one not in before)
        os.kill(child.pid, signal.SIGKILL)


def test_an_error_of_the_caller_ends_it(tmp_path: Path) -> None:
    def fail() -> None:
        with Printer(tmp_path):
            raise KeyError

    before = psutil.Process().children()
    with pytest.raises(KeyError):
        fail()
    assert [one for one in psutil.Process().children() if one not in before] == []
