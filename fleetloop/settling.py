"""When an error has settled, the same for a check, a rehearsal, a summary, a table and a figure.

An error has settled at the time from which on it stays within ±`SETTLE_BAND`.
"""

import numpy as np

SETTLE_BAND = 0.05
"""An error within this has settled: [m], [rad], [m/s]."""
LOST_M = 0.5
"""A robot or a path variable that ends farther off than this, and started closer, is lost."""
FINAL_S = 5.0
"""End of a run [s]: a final error is the greatest in this last part of its rows."""


def settled_from(values: np.ndarray, band: float = SETTLE_BAND) -> int:
    """The index from which all values are within the band; their number if the last isn't."""
    outside = np.flatnonzero(~(np.abs(values) <= band))
    return int(outside[-1]) + 1 if len(outside) else 0


def settle_s(t: np.ndarray, values: np.ndarray, band: float = SETTLE_BAND) -> float | None:
    """Time from which on it is within the band [s]; 0: always, None: it ends outside."""
    first = settled_from(values, band)
    if first == 0:
        return 0.0
    return round(float(t[first]), 9) if first < len(values) else None
