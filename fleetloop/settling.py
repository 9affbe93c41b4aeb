"""Limits of an error that has settled, the same for a check, a rehearsal, a summary and a table."""

SETTLE_BAND = 0.05
"""An error within this has settled: [m], [rad], [m/s]."""
LOST_M = 0.5
"""A robot or a path variable that ends farther off than this, and started closer, is lost."""
FINAL_S = 5.0
"""The end of a run: what is called final is the greatest error of this last part of its rows."""
