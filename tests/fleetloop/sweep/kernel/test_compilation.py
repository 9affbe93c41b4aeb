"""The compiled loop: made of the sources as they stand, never of older ones."""

import ast
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from configs.loading import load
from configs.resolve import schedule
from fleetloop.sweep.kernel import compilation, layout, linking, loop, run
from fleetloop.sweep.kernel.linking import Linker, LinkError
from fleetloop.sweep.kernel.lowering import lowered
from fleetloop.sweep.kernel.outcome import columns

EQUATIONS = {
    "agents/laws/adaptive_dsc.py": ("surface", "virtual_controls", "approach", "bound_estimate"),
    "agents/laws/adaptive_dsc_robust.py": ("bounded_approach", "adapt_normalised"),
    "agents/laws/path_errors.py": ("path_errors", "wrap"),
    "agents/coordination.py": ("advanced", "period_map"),
    "agents/paths.py": ("cosine_reference", "spline_jet", "turning_reference"),
    "plant/integrate.py": ("runge_kutta", "within_bounds", "net_torques"),
    "plant/body.py": ("rates", "rolling_rates", "rolling_speeds"),
}
ROOT = Path(linking.__file__).parents[3]


def functions_of(text: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse(text)
    return {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}


def arithmetic(function: ast.FunctionDef) -> list[str]:
    """All expressions in which numbers are computed, with Python's names for what is said again."""
    kinds = (ast.BinOp, ast.Compare)
    nodes = (node for part in function.body for node in ast.walk(part))
    said = [ast.unparse(node) for node in nodes if isinstance(node, kinds)]
    return sorted(it.replace("least(", "min(").replace("most(", "max(") for it in said)


@pytest.mark.parametrize("file", EQUATIONS)
def test_equations_are_compiled_as_they_stand_in_their_sources(file: str) -> None:
    linked = functions_of(compilation.linked_text())
    source = functions_of((ROOT / file).read_text("utf-8"))
    for name in EQUATIONS[file]:
        assert arithmetic(linked[name]) == arithmetic(source[name]), name


def test_the_compiled_loop_does_what_the_same_text_does_uncompiled() -> None:
    scenario = load("paper", ["until_s=0.05"])
    (compiled,) = run([scenario], {"x_m", "tau_right_wheel_N_m", "kappa_hat"}, Stop())
    ticks = schedule(scenario)
    made = lowered(scenario, ticks)
    kept = columns(frozenset({"x_m", "tau_right_wheel_N_m", "kappa_hat"}))
    room = [one.rows(4, 50, ticks.period_ns) for one in kept]
    with np.errstate(all="raise"):
        result = loop.simulate(
            *(it.view(np.recarray) for it in made[:4]),
            *(made.changes, made.leader_m_s, made.curves),
            np.zeros(8, layout.MAP).view(np.recarray),
            tuple(layout.one(it).view(np.recarray) for it in (layout.TRUTH, layout.TOLD)),
            (kept[0].numbers, kept[1].numbers),
            (room[0][0], room[1][0]),
        )
    assert result == (loop.NOTHING, 50, 0)
    for number, robot in enumerate(scenario.names):
        assert np.array_equal(room[0][1][number], compiled.record.plant[robot])
        assert np.array_equal(room[1][1][number], compiled.record.controller[robot])


def test_the_loop_is_compiled_once_whatever_is_asked_of_it() -> None:
    for signals in ({"s"}, {"x_m"}, {"s", "x_m", "kappa_hat"}, set()):
        run([load("paper", ["until_s=0.01"])], signals, Stop())
    run([load("spline_gate", ["until_s=0.01"])], {"s"}, Stop())
    run([load("lossy_chain", ["until_s=0.01"])], {"s"}, Stop())
    loop_compiled: Any = compilation.compiled_loop()
    assert len(loop_compiled.signatures) == 1


TEXT = """
from numba import njit


@njit(cache=True)
def answer():
    return {}
"""


def test_changed_text_is_never_answered_by_what_was_compiled_before(tmp_path: Path) -> None:
    for number in (1, 2, 1):
        module = compilation.module_of(TEXT.format(number), tmp_path)
        assert module.answer() == number
    assert len(list(tmp_path.iterdir())) == 2


def test_what_was_compiled_is_taken_by_the_next_process(tmp_path: Path) -> None:
    first = compilation.module_of(TEXT.format(3), tmp_path)
    assert first.answer() == 3
    again = compilation.module_of(TEXT.format(3), tmp_path)
    assert again.answer() == 3
    assert sum(again.answer.stats.cache_hits.values()) == 1


def test_a_file_that_someone_changed_in_the_cache_is_written_again(tmp_path: Path) -> None:
    module = compilation.module_of(TEXT.format(4), tmp_path)
    path = Path(str(module.__file__))
    path.write_text(TEXT.format(5), "utf-8")
    assert compilation.module_of(TEXT.format(4), tmp_path).answer() == 4
    assert path.read_text("utf-8") == TEXT.format(4)


def test_where_the_cache_cannot_be_written_it_compiles_anew(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("", "utf-8")
    assert compilation.module_of(TEXT.format(6), blocked / "cache").answer() == 6


def test_a_name_of_two_modules_is_refused() -> None:
    linker = Linker("@_equation")
    linker.add("agents.laws.path_errors", "wrap")
    linker._from["path_errors"] = "elsewhere"
    with pytest.raises(LinkError, match="path_errors is defined in elsewhere and in agents"):
        linker.add("agents.laws.path_errors", "path_errors")


def test_a_name_that_a_module_does_not_have_is_refused() -> None:
    with pytest.raises(LinkError, match=r"agents\.laws\.path_errors has no wrapped of its own"):
        Linker("@_equation").add("agents.laws.path_errors", "wrapped")


def test_old_loops_are_removed_but_those_used_last_and_what_is_not_one(tmp_path: Path) -> None:
    long_ago_s = SYSTEM_CLOCK.wall_ns() / 1e9 - 2 * compilation.UNUSED_S
    for n in range(6):
        old = tmp_path / f"fleetloop_kernel_{n}"
        old.mkdir()
        os.utime(old, (long_ago_s + n, long_ago_s + n))
    other = tmp_path / "other"
    other.mkdir()
    os.utime(other, (long_ago_s, long_ago_s))
    module = compilation.module_of("x = 1\n", tmp_path)
    kept = {path.name for path in tmp_path.iterdir()}
    assert kept == {module.__name__, "fleetloop_kernel_5", "fleetloop_kernel_4", "other"}


def test_a_loop_that_was_used_lately_is_kept_for_whom_it_serves(tmp_path: Path) -> None:
    for n in range(6):
        (tmp_path / f"fleetloop_kernel_{n}").mkdir()
    compilation.module_of("x = 2\n", tmp_path)
    assert len(list(tmp_path.iterdir())) == 7
