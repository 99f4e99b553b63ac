"""Group recordings by their factors, and compute the means of each group."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from teleop.evaluation.comparison import (
    NEVER_UPDATED,
    NO_LEVEL,
    OF_RESULT,
    RESULT,
    SUBJECT,
    UNITS,
    Compared,
    values_of,
)
from teleop.evaluation.means import Mean, mean_of, mean_tracking
from teleop.evaluation.result import Result
from teleop.evaluation.short_remarks import remark_counts

HOLDING = {"force_n": "force", "depth_m": "depth", "damping_at_hz": "damping_at_hz"}
"""Attributes of `Result` that state where k and b hold, by name with unit."""


@dataclass(frozen=True)
class Group:
    """Group of recordings with the same levels of all factors."""

    levels: tuple[str, ...]
    """Level of each factor."""
    means: dict[str, dict[str, Mean]]
    """Means of k [N/m], b [N s/m] and e_f [N], by `RESULT` or the name of the estimator."""
    kinds: dict[str, dict[str, dict[str, int]]]
    """Kinds of the values of each mean, with the number of recordings of each kind."""
    missing: dict[str, dict[str, str]]
    """Files without a value, each with the reason, by `RESULT` or the name of the estimator."""
    tracking: dict[str, Mean]
    """Means of gain, phase_deg, rms_m and frequency_hz (`mean_tracking`); empty without a
    target."""
    pooled: tuple[str, ...]
    """Planned factors, besides the subject, of which the group contains several levels."""
    subjects: int
    """Number of subjects, if there are two or more and some have several recordings in this group;
    otherwise 0."""
    holding: dict[str, tuple[float, float]]
    """Smallest and largest force_n and depth_m of the tangents of the results, and smallest and
    largest frequency at which their b is k''/omega, damping_at_hz. Names without a value are left
    out."""
    depth_from: tuple[str, ...]
    """Positions at which these depths are zero."""
    force_lags: tuple[float, ...]
    """Time constants of the force channel that are compensated [s], each once."""
    remarks: dict[str, int]
    """Remarks on the results in short form, with the number of results that have each."""


def grouped(
    rows: Sequence[Compared], by: Sequence[str], planned: Mapping[str, Sequence[str]]
) -> list[Group]:
    """Return the groups of recordings with the same levels, in the order of the levels.

    The levels of a factor have the order of the plan. Levels that the plan does not contain follow.
    If all of them are numbers, they are sorted by their values. Otherwise they have the order in
    which they first occur.

    Parameters
    ----------
    rows
        The recordings.
    by
        Names of factors. A factor that is not known for a recording has the level `NO_LEVEL`.
    planned
        Levels of the factors of a series in the order of its plan, by the name of the factor.
    """
    members: dict[tuple[str, ...], list[Compared]] = {}
    for row in rows:
        members.setdefault(row.levels(by), []).append(row)
    ranks = [
        ranks_of(planned.get(name, ()), (levels[i] for levels in members))
        for i, name in enumerate(by)
    ]
    ordered = sorted(
        members,
        key=lambda levels: [rank[level] for rank, level in zip(ranks, levels, strict=True)],
    )
    return [group_of(levels, members[levels], planned) for levels in ordered]


def group_of(
    levels: tuple[str, ...], rows: Sequence[Compared], planned: Iterable[str] = ()
) -> Group:
    """Return the group of the given recordings.

    Parameters
    ----------
    levels
        Levels of the factors by which the recordings are grouped.
    rows
        The recordings of the group. All of them have these levels.
    planned
        Names of the factors of a series.
    """
    missing: dict[str, dict[str, str]] = {}
    for row in rows:
        if not row.result.identifiable:
            missing.setdefault(RESULT, {})[row.file] = "; ".join(row.result.reasons)
        for name, one in row.estimates.items():
            if not math.isfinite(one.k):
                missing.setdefault(name, {})[row.file] = NEVER_UPDATED
    tracked = [row.tracking for row in rows if row.tracking]
    results = [row.result for row in rows if row.result.identifiable]
    subjects = Counter(row.factors[SUBJECT] for row in rows if SUBJECT in row.factors)
    repeated = len(subjects) > 1 and max(subjects.values()) > 1
    pooled = tuple(
        name
        for name in planned
        if name != SUBJECT and len({row.factors.get(name) for row in rows}) > 1
    )
    means: dict[str, dict[str, Mean]] = {}
    kinds: dict[str, dict[str, dict[str, int]]] = {}
    for method in dict.fromkeys([RESULT, *(name for row in rows for name in row.estimates)]):
        found = [values_of(row, method) for row in rows]
        symbols = OF_RESULT if method == RESULT else UNITS
        values = {symbol: [one[symbol] for one in found if symbol in one] for symbol in symbols}
        means[method] = {symbol: mean_of(each) for symbol, each in values.items()}
        kinds[method] = {
            symbol: dict(sorted(Counter(one.kind for one in each).items(), reverse=True))
            for symbol, each in values.items()
        }
    return Group(
        levels,
        means,
        kinds,
        missing,
        mean_tracking(tracked),
        pooled,
        len(subjects) if repeated else 0,
        ranges(results),
        tuple(sorted({one.depth_from for one in results})),
        tuple(sorted({row.force_lag for row in rows})),
        remark_counts(results),
    )


def ranges(results: Sequence[Result]) -> dict[str, tuple[float, float]]:
    """Return the smallest and largest value of each quantity in `HOLDING`.

    A quantity that no result contains is omitted.
    """
    found = {}
    for name, attribute in HOLDING.items():
        values = [getattr(one, attribute) for one in results]
        values = [value for value in values if value is not None]
        if values:
            found[name] = (min(values), max(values))
    return found


def ranks_of(planned: Sequence[str], occurring: Iterable[str]) -> dict[str, int]:
    """Return the rank of each level of a factor, from 0. The function `grouped` sorts by ranks.

    The levels in `planned` are first, in their order. The other levels that occur follow.
    """
    others = [level for level in dict.fromkeys(occurring) if level not in planned]
    with contextlib.suppress(ValueError):
        others = sorted(others, key=lambda level: math.inf if level == NO_LEVEL else float(level))
    return {level: rank for rank, level in enumerate([*planned, *others])}
