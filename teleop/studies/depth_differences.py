"""Find the factors of a study that have levels with different depths of the palpation."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from teleop.evaluation.across.comparison import Compared

LARGE = 1.1
"""Ratio of the larger to the smaller depth above which a warning is given. The depths of repeated
trials differ by a few percent."""


def depth_note(rows: Sequence[Compared], factors: Sequence[str]) -> str:
    """Return a warning if the depth of the palpation differs between the levels of a factor.

    If no two depths have a ratio larger than `LARGE`, the result is empty. The stiffness of many
    specimens increases with the depth. If two levels of a factor have different depths, the
    stiffness can therefore also differ between these levels. The analysis of variance then counts
    this difference as an effect of the factor.
    """
    ratios = {name: depth_ratio(rows, name, factors) for name in factors}
    large = {name: ratio for name, ratio in ratios.items() if ratio > LARGE}
    if not large:
        return ""
    names = " and ".join(f"{name} (by up to {ratio - 1.0:.0%})" for name, ratio in large.items())
    return (
        f"The depth of the palpation differs between the levels of {names}. If the stiffness of "
        "the specimen depends on the depth, this is part of the effect."
    )


def depth_ratio(rows: Sequence[Compared], factor: str, factors: Sequence[str]) -> float:
    """Return the largest ratio of the depths of the palpation at two levels of a factor.

    Only recordings with the same levels of all other factors are compared. The depth at a level is
    the median of the depths of the recordings with this level. The result is 1 if there are no
    depths to compare.
    """
    others = [name for name in factors if name != factor]
    depths: dict[tuple[str, ...], dict[str, list[float]]] = {}
    for row in rows:
        if row.result.depth:
            (level,) = row.levels([factor])
            depths.setdefault(row.levels(others), {}).setdefault(level, []).append(row.result.depth)
    medians = [[median(found) for found in one.values()] for one in depths.values()]
    return max((max(one) / min(one) for one in medians), default=1.0)
