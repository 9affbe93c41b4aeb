"""What the edges of the network did in a run: messages by their fate, and the age of data."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from configs.signals import AGE_PREFIX


def network(
    controllers: Mapping[str, np.ndarray], messages: Mapping[str, Mapping[str, Mapping[str, int]]]
) -> dict[str, dict[str, Any]] | None:
    """Per edge "source -> hearer", in the order of names; None if of none is anything known.

    Args:
        controllers: rows of the robots.
        messages: counts by hearer, source and fate, of emulated edges.
    """
    edges: dict[str, dict[str, Any]] = {}
    for hearer, sources in messages.items():
        for source, counts in sources.items():
            edges[f"{source} -> {hearer}"] = dict(counts)
    for hearer, rows in controllers.items():
        for source, ages in ages_of(rows).items():
            edges.setdefault(f"{source} -> {hearer}", {})["age_s"] = _statistics(ages)
    return dict(sorted(edges.items())) or None


def ages_of(rows: np.ndarray) -> dict[str, np.ndarray]:
    """Ages of what a robot used [s], by its sources, over the ticks."""
    return {
        name.removeprefix(AGE_PREFIX).removesuffix("_s"): rows[name]
        for name in rows.dtype.names or ()
        if name.startswith(AGE_PREFIX)
    }


def _statistics(ages_s: np.ndarray) -> dict[str, float] | None:
    """Mean, 99th percentile and largest; None if nothing was ever heard."""
    heard = ages_s[np.isfinite(ages_s)]
    if not len(heard):
        return None
    return {
        "mean": round(float(heard.mean()), 6),
        "p99": round(float(np.percentile(heard, 99)), 6),
        "max": round(float(heard.max()), 6),
    }
