"""Group recordings by their factors, and compute the means of each group.

A factor is a property in which recordings differ, for example the condition. Its level is the value
for one recording, for example `mimic`.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from estimation.quantities import RESULTS
from teleop.evaluation.across.comparison import (
    BODY,
    NEVER_UPDATED,
    NO_LEVEL,
    OF_RESULT,
    RESULT,
    SUBJECT,
    Compared,
    values_of,
)
from teleop.evaluation.across.means import Mean, mean_of, mean_tracking
from teleop.evaluation.batch.stiffness_result import StiffnessResult

IN_PARENTHESES = re.compile(r" \([^()]*\d[^()]*\)")
"""Pattern of a part in parentheses that contains a number."""
FROM_FIRST_NUMBER = re.compile(r"[:;,][^:;,\d]*\d.*")
"""Pattern of the first part of a sentence that contains a number, and of all parts after it."""


def short(remark: str) -> str:
    """Return a remark without its numbers, so that remarks on several recordings can be equal.

    For example, the remark "bad fit: 12 % of the force variance is not explained" becomes "bad
    fit". Parentheses that contain a number are removed first. If a number remains after a colon, a
    semicolon or a comma, the text from this punctuation mark to its end is removed.
    """
    return FROM_FIRST_NUMBER.sub("", IN_PARENTHESES.sub("", remark))


def remark_counts(results: Iterable[StiffnessResult]) -> dict[str, int]:
    """Return the number of results with each remark, by the remark without its numbers."""
    return dict(Counter(text for one in results for text in dict.fromkeys(map(short, one.reasons))))


HOLDING = {"force_n": "force", "depth_m": "depth", "damping_at_hz": "damping_at_hz"}
"""Attributes of `StiffnessResult` that contain the force and the depth at which k holds, and the
frequency at which b holds. The keys are the names in reports, which contain the unit."""


@dataclass(frozen=True)
class Group:
    """Means over recordings that have the same levels of the chosen factors.

    A factor is a property in which recordings differ. Its level is the value for one recording.
    """

    levels: tuple[str, ...]
    """Level of each factor by which the recordings are grouped."""
    means: dict[str, dict[str, Mean]]
    """Means of k [N/m], b [N s/m] and e_f [N], by `RESULT` or the name of the estimator."""
    kinds: dict[str, dict[str, dict[str, int]]]
    """Number of recordings of each kind of value (`teleop.evaluation.batch.kinds`), for each
    mean."""
    missing: dict[str, dict[str, str]]
    """Reason why a file has no value, by the name of the file. There is one dictionary for `RESULT`
    and one for each estimator."""
    tracking: dict[str, Mean]
    """Means of gain, phase_deg, rms_m and frequency_hz (`mean_tracking`); empty without a
    target."""
    pooled: tuple[str, ...]
    """Stated factors, except the subject, that have several levels within this group."""
    unnamed: bool
    """Whether several recordings, of which no factor is stated, are averaged without `levels`."""
    unit: str | None
    """Factor whose levels are averaged first, and count as independent in the interval of a mean
    (`independent_unit`); None if each recording is independent."""
    holding: dict[str, tuple[float, float]]
    """Smallest and largest value of each quantity in `HOLDING`. A quantity that no result contains
    is left out."""
    depth_from: tuple[str, ...]
    """Positions at which the depths in `holding` are zero: contact point, lowest position."""
    force_lags: tuple[float, ...]
    """Time constants of the force channel that are compensated in results [s], each once."""
    lost_motions: tuple[float, ...]
    """Lost motions that are compensated in results [m], each once."""
    remarks: dict[str, int]
    """Number of results that have a remark, by the short form of the remark."""


def grouped(
    rows: Sequence[Compared],
    by: Sequence[str],
    planned: Mapping[str, Sequence[str]],
    stated: Sequence[str] = (),
) -> list[Group]:
    """Divide recordings into groups with the same levels of factors, and sort the groups.

    A factor is a property in which recordings differ, for example `condition`. Its level is the
    value for one recording, for example `mimic`. The groups are sorted by the levels of the first
    factor, then by those of the second factor, and so on (see `ranks_of`). `stated` are all factors
    that say how the recordings differ, besides those of the plan of a series (`planned`).
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
    names = dict.fromkeys([*planned, *stated])
    return [group_of(levels, members[levels], names) for levels in ordered]


def group_of(
    levels: tuple[str, ...], rows: Sequence[Compared], stated: Iterable[str] = ()
) -> Group:
    """Return the mean results and estimates of the recordings of one group, see `Group`.

    `stated` are all factors that say how the recordings differ.
    """
    names = {*stated, *BODY}
    missing: dict[str, dict[str, str]] = {}
    for row in rows:
        if not row.result.identifiable:
            missing.setdefault(RESULT, {})[row.file] = "; ".join(row.result.reasons)
        for name, one in row.estimates.items():
            if not math.isfinite(one.k):
                missing.setdefault(name, {})[row.file] = NEVER_UPDATED
    tracked = [(row, row.tracking) for row in rows if row.tracking]
    results = [row.result for row in rows if row.result.identifiable]
    unit = independent_unit(rows)
    pooled = tuple(
        name
        for name in stated
        if name != SUBJECT and len({row.factors.get(name) for row in rows}) > 1
    )
    means: dict[str, dict[str, Mean]] = {}
    kinds: dict[str, dict[str, dict[str, int]]] = {}
    for method in dict.fromkeys([RESULT, *(name for row in rows for name in row.estimates)]):
        found = [(row.factors.get(unit or ""), values_of(row, method)) for row in rows]
        symbols = OF_RESULT if method == RESULT else RESULTS
        values = {
            symbol: [(level, one[symbol]) for level, one in found if symbol in one]
            for symbol in symbols
        }
        means[method] = {
            symbol: mean_of([one for _, one in each], [str(level) for level, _ in each if level])
            for symbol, each in values.items()
        }
        kinds[method] = {
            symbol: dict(sorted(Counter(one.kind for _, one in each).items(), reverse=True))
            for symbol, each in values.items()
        }
    return Group(
        levels,
        means,
        kinds,
        missing,
        mean_tracking(
            [tracking for _, tracking in tracked], [row.factors[unit] for row, _ in tracked if unit]
        ),
        pooled,
        not levels and len(rows) > 1 and any(row.factors.keys().isdisjoint(names) for row in rows),
        unit,
        ranges(results),
        tuple(sorted({one.depth_from for one in results})),
        tuple(sorted({row.force_lag for row in rows})),
        tuple(sorted({row.lost_motion for row in rows})),
        remark_counts(results),
    )


def independent_unit(rows: Sequence[Compared], by: Sequence[str] = ()) -> str | None:
    """Return the factor whose levels are independent of each other, unlike the recordings of one.

    It is the subject or the palpated body, if several of them have repeated recordings. It is none
    of the factors `by`.
    """
    for name in (SUBJECT, *BODY):
        levels = [row.factors.get(name) for row in rows]
        if name not in by and None not in levels and 1 < len(set(levels)) < len(levels):
            return name
    return None


def ranges(results: Sequence[StiffnessResult]) -> dict[str, tuple[float, float]]:
    """Return the range of the forces, depths and frequencies at which the results hold.

    The result contains the smallest and the largest value of each quantity, by the names in
    `HOLDING`. A quantity that no result contains is left out.
    """
    found = {}
    for name, attribute in HOLDING.items():
        values = [getattr(one, attribute) for one in results]
        values = [value for value in values if value is not None]
        if values:
            found[name] = (min(values), max(values))
    return found


def ranks_of(planned: Sequence[str], occurring: Iterable[str]) -> dict[str, int]:
    """Return the rank of each level of a factor: its place in the order of the levels, from 0.

    A factor is a property in which recordings differ. Its levels are the values of this property.
    The planned levels are first. Then follow the levels that are not planned. If all of these are
    numbers, they are sorted by their values, and `NO_LEVEL` (level not known) is last. Otherwise,
    they keep the order in `occurring`.
    """
    others = [level for level in dict.fromkeys(occurring) if level not in planned]
    with contextlib.suppress(ValueError):
        others = sorted(others, key=lambda level: math.inf if level == NO_LEVEL else float(level))
    return {level: rank for rank, level in enumerate([*planned, *others])}
