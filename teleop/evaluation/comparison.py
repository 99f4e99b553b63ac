"""Compare several recordings: the results of each recording, and the means of groups."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from estimation.summary import EstimatorSummary
from teleop.errors import InputError
from teleop.evaluation.evaluation_result import Evaluation
from teleop.evaluation.result import Result
from teleop.evaluation.tracking import COLUMNS, Tracking

NO_LEVEL = "-"
"""Level of a factor that is not known for a recording."""
RESULT = "result"
"""Name of the method that gives the batch result. The other methods are the estimators."""
AVERAGE = "average"
"""Kind of the stiffness of an estimator: the average slope of lines through the datum."""
KIND_OF_K = {RESULT: "tangent"}
"""Kind of the stiffness of the methods other than the estimators: for the result, the tangent at
half of the force range."""
NEVER_UPDATED = "the estimator was never updated: no contact or no motion"
SUBJECT = "subject"
"""Name of the random factor. Its levels are a sample of persons or specimens."""


@dataclass(frozen=True)
class Compared:
    """Results of one recording."""

    file: str
    """Name of the file."""
    factors: dict[str, str]
    """Level of each factor that is known for the recording, by the name of the factor."""
    result: Result
    """Stiffness and damping with their intervals, or the reasons why there are none."""
    estimates: dict[str, EstimatorSummary]
    """Averages of the estimates over the record, by the name of the estimator."""
    tracking: Tracking | None = None
    """Gain, phase and error of the slave relative to the target of `mimic`; None without a
    target."""

    def levels(self, by: Sequence[str]) -> tuple[str, ...]:
        """Return the levels of the factors `by`."""
        return tuple(self.factors.get(name, NO_LEVEL) for name in by)


class Mean(NamedTuple):
    """Mean of a quantity over a group of recordings, with its 95 % interval."""

    value: float
    """Mean; NaN if there are no values."""
    half: float
    """Half width of the interval of the mean; NaN if there is no interval."""
    recordings: int
    """Number of recordings in the mean."""


@dataclass(frozen=True)
class Group:
    """Group of recordings with the same levels of all factors."""

    levels: tuple[str, ...]
    """Level of each factor."""
    means: dict[str, dict[str, Mean]]
    """Means of k [N/m], b [N s/m] and e_f [N], by `RESULT` or the name of the estimator."""
    missing: dict[str, dict[str, str]]
    """Files without a value, each with the reason, by `RESULT` or the name of the estimator."""
    tracking: dict[str, Mean]
    """Means of the tracking values gain, phase_deg, rms_m and frequency_hz; empty without a
    target."""
    subjects: int
    """Number of subjects, if there are two or more and some have several recordings in this group;
    otherwise 0."""


def compared(
    file: str,
    factors: Mapping[str, str],
    evaluation: Evaluation,
    tracking: Tracking | None = None,
) -> Compared:
    """Return the results of one evaluated recording."""
    result = evaluation.analysis.result
    return Compared(file, dict(factors), result, evaluation.summaries(), tracking)


def mean_of(values: Sequence[float], halves: Sequence[float]) -> Mean:
    """Return the mean of a quantity over recordings, with its 95 % interval.

    Parameters
    ----------
    values
        One finite value per recording.
    halves
        Half width of the 95 % interval of each value; NaN if there is no interval.

    Returns
    -------
    The mean. For two or more recordings, its interval is computed with Student's t from the spread
    between the recordings. For one recording, it is the interval of this recording.
    """
    if not values:
        return Mean(math.nan, math.nan, 0)
    if len(values) == 1:
        return Mean(values[0], halves[0], 1)
    spread = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    return Mean(
        float(np.mean(values)), float(stdtrit(len(values) - 1, 0.975)) * spread, len(values)
    )


def grouped(
    rows: Sequence[Compared], by: Sequence[str], planned: Mapping[str, Sequence[str]]
) -> list[Group]:
    """Return the groups of recordings with the same levels, in the order of the levels.

    The levels of a factor have the order of the plan. Levels that no plan contains follow these, in
    the order of their numbers, or in the order in which they first occur if one is not a number.

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
    return [group_of(levels, members[levels]) for levels in ordered]


def group_of(levels: tuple[str, ...], rows: Sequence[Compared]) -> Group:
    """Return the group that consists of `rows`, recordings with the same levels."""
    missing: dict[str, dict[str, str]] = {}
    for row in rows:
        if not row.result.identifiable:
            missing.setdefault(RESULT, {})[row.file] = "; ".join(row.result.reasons)
        for name, one in row.estimates.items():
            if not math.isfinite(one.k):
                missing.setdefault(name, {})[row.file] = NEVER_UPDATED
    tracked = [row.tracking for row in rows if row.tracking]
    followed = ("gain", "phase_deg", "rms_m", "frequency_hz") if tracked else ()
    blank = [math.nan] * len(tracked)
    tracking = {name: mean_of([getattr(t, name) for t in tracked], blank) for name in followed}
    subjects = Counter(row.factors[SUBJECT] for row in rows if SUBJECT in row.factors)
    pooled = len(subjects) > 1 and max(subjects.values()) > 1
    return Group(levels, means(rows), missing, tracking, len(subjects) if pooled else 0)


def ranks_of(planned: Sequence[str], occurring: Iterable[str]) -> dict[str, int]:
    """Return the position of each level of a factor in the order of `grouped`."""
    others = [level for level in dict.fromkeys(occurring) if level not in planned]
    with contextlib.suppress(ValueError):
        others = sorted(others, key=lambda level: math.inf if level == NO_LEVEL else float(level))
    return {level: rank for rank, level in enumerate([*planned, *others])}


def means(rows: Sequence[Compared]) -> dict[str, dict[str, Mean]]:
    """Return the means of the results and of the estimates of recordings."""
    results = [row.result for row in rows if row.result.identifiable]
    found = {RESULT: {symbol: mean_result(results, symbol) for symbol in ("k", "b")}}
    for name in dict.fromkeys(name for row in rows for name in row.estimates):
        summaries = [row.estimates[name] for row in rows if name in row.estimates]
        found[name] = {}
        for symbol in ("k", "b", "e_f"):
            values = [getattr(summary, symbol) for summary in summaries]
            values = [value for value in values if math.isfinite(value)]
            found[name][symbol] = mean_of(values, [math.nan] * len(values))
    return found


def mean_result(results: Sequence[Result], symbol: str) -> Mean:
    """Return the mean of k or b (`symbol`) over results, all of which are identifiable."""
    values = [getattr(result, symbol) for result in results]
    halves = [
        0.5 * (getattr(result, f"{symbol}_high") - getattr(result, f"{symbol}_low"))
        for result in results
    ]
    return mean_of(values, halves)


def check_factors(rows: Sequence[Compared], by: Sequence[str]) -> None:
    """Raise InputError if a factor is not known for any of the recordings."""
    known = dict.fromkeys(name for row in rows for name in row.factors)
    for name in by:
        if name not in known:
            raise InputError(f"factor {name!r}: expected one of {', '.join(known)}")


def tidy_rows(rows: Iterable[Compared], by: Sequence[str]) -> list[dict[str, Any]]:
    """Return one row for each recording and method, for a table file.

    The row of the method `result` contains the batch result with its 95 % interval. The row of an
    estimator contains the averages of its estimates over the record.
    """
    found = []
    for row in rows:
        start = {"file": row.file, **dict(zip(by, row.levels(by), strict=True))}
        tracking = {text: getattr(row.tracking, key, None) for key, text in COLUMNS.items()}
        r = row.result
        found.append(
            {
                **start,
                "method": RESULT,
                "kind of k": KIND_OF_K[RESULT],
                "at force [N]": r.force,
                "at depth [m]": r.depth,
                "k [N/m]": r.k,
                "k low [N/m]": r.k_low,
                "k high [N/m]": r.k_high,
                "b [N s/m]": r.b,
                "b low [N s/m]": r.b_low,
                "b high [N s/m]": r.b_high,
                "e_f [N]": None,
                "reasons": "; ".join(r.reasons),
                **tracking,
            }
        )
        blank = dict.fromkeys(found[-1])
        found += [
            {
                **blank,
                **start,
                "method": name,
                "kind of k": AVERAGE,
                "k [N/m]": one.k,
                "b [N s/m]": one.b,
                "e_f [N]": one.e_f,
                **tracking,
            }
            for name, one in row.estimates.items()
        ]
    return found
