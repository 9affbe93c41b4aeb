"""What the kernel says of processes."""

import os
from pathlib import Path

from bridge.process.kernel_stat import KernelStat, kernel_stat


def test_of_this_process_it_knows_state_parent_and_time() -> None:
    stat = kernel_stat(os.getpid())
    assert stat is not None
    assert (stat.state, stat.parent) == ("R", os.getppid())
    assert stat.cpu_ticks <= sum(os.times()[:2]) * os.sysconf("SC_CLK_TCK") + 1


def test_a_name_may_have_brackets_and_blanks(tmp_path: Path) -> None:
    (tmp_path / "7").mkdir()
    stat = tmp_path / "7" / "stat"
    stat.write_text("7 (a) R 1 (b) T 3 7 7 0 -1 4 0 0 0 0 12 5 0 0 20 0 1 0\n")
    assert kernel_stat(7, tmp_path) == KernelStat("T", 3, 17)
    stat.write_text("7 (cut)")
    assert kernel_stat(7, tmp_path) is None
    assert kernel_stat(8, tmp_path) is None
