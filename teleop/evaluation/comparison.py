"""Compare several recordings: the results of each recording, and the means of groups."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from estimation.summary import EstimatorSummary
from teleop.errors import InputError
from teleop.evaluation.evaluation_result import Evaluation
from teleop.evaluation.kinds import OF_ESTIMATES
from teleop.evaluation.means import Mean, Value, mean_of, mean_tracking
from teleop.evaluation.result import Result
from teleop.evaluation.tracking import COLUMNS, Tracking

NO_LEVEL = "-"
"""Level of a factor that is not known for a recording."""
RESULT = "result"
"""Name of the method that gives the batch result. The other methods are the estimators."""
UNITS = {"k": "N/m", "b": "N s/m", "e_f": "N"}
"""Unit of each quantity that is compared, by its symbol."""
OF_RESULT = ("k", "b")
"""Symbols of the quantities of a result."""
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
        """Return the level of each factor in `by`, for this recording."""
        return tuple(self.factors.get(name, NO_LEVEL) for name in by)


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


def compared(
    file: str,
    factors: Mapping[str, str],
    evaluation: Evaluation,
    tracking: Tracking | None = None,
) -> Compared:
    """Return the results of one evaluated recording."""
    result = evaluation.analysis.result
    return Compared(file, dict(factors), result, evaluation.summaries(), tracking)


def values_of(row: Compared, method: str) -> dict[str, Value]:
    """Return the values of a method for a recording, by symbol; empty if there are none."""
    if method != RESULT:
        one = row.estimates.get(method)
        return {
            symbol: Value(getattr(one, symbol), math.nan, kind)
            for symbol, kind in OF_ESTIMATES.items()
            if one and math.isfinite(getattr(one, symbol))
        }
    result = row.result
    if not result.identifiable:
        return {}
    return {
        symbol: Value(
            getattr(result, symbol),
            0.5 * (getattr(result, f"{symbol}_high") - getattr(result, f"{symbol}_low")),
            kind,
        )
        for symbol, kind in result.kinds.items()
    }


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
    return [group_of(levels, members[levels], planned) for levels in ordered]


def group_of(
    levels: tuple[str, ...], rows: Sequence[Compared], planned: Iterable[str] = ()
) -> Group:
    """Return the group that consists of `rows`, recordings with the same levels.

    Parameters
    ----------
    levels
        Levels of the factors by which the recordings are grouped.
    rows
        The recordings.
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
    )


def ranks_of(planned: Sequence[str], occurring: Iterable[str]) -> dict[str, int]:
    """Return the rank of each level of a factor, from 0. The function `grouped` sorts by ranks.

    The levels in `planned` are first, in their order. The other levels that occur follow.
    """
    others = [level for level in dict.fromkeys(occurring) if level not in planned]
    with contextlib.suppress(ValueError):
        others = sorted(others, key=lambda level: math.inf if level == NO_LEVEL else float(level))
    return {level: rank for rank, level in enumerate([*planned, *others])}


def check_factors(rows: Sequence[Compared], by: Sequence[str]) -> None:
    """Raise InputError if a factor is not known for any of the recordings."""
    known = dict.fromkeys(name for row in rows for name in row.factors)
    for name in by:
        if name not in known:
            raise InputError(f"factor {name!r}: expected one of {', '.join(known)}")


def tidy_rows(rows: Iterable[Compared], factors: Sequence[str]) -> list[dict[str, Any]]:
    """Return one row for each recording and method, for a table file.

    The row of the method `result` contains the batch result with its 95 % interval. The row of an
    estimator contains the averages of its estimates over the record.

    Parameters
    ----------
    rows
        The recordings.
    factors
        Names of the factors that have a column.
    """
    found = []
    for row in rows:
        start = {"file": row.file, **dict(zip(factors, row.levels(factors), strict=True))}
        tracking = {text: getattr(row.tracking, key, None) for key, text in COLUMNS.items()}
        r = row.result
        for method in (RESULT, *row.estimates):
            values = values_of(row, method)
            batch = method == RESULT
            cells: dict[str, Any] = {"method": method}
            for symbol in OF_RESULT:
                kind = values[symbol].kind if symbol in values else None
                cells[f"kind of {symbol}"] = kind
            cells["at force [N]"] = r.force if batch else None
            cells["at depth [m]"] = r.depth if batch else None
            cells["b at frequency [Hz]"] = r.damping_at_hz if batch else None
            for symbol, unit in UNITS.items():
                cells[f"{symbol} [{unit}]"] = values[symbol].value if symbol in values else None
                for end in ("low", "high") if symbol != "e_f" else ():
                    value = getattr(r, f"{symbol}_{end}") if batch else None
                    cells[f"{symbol} {end} [{unit}]"] = value
            reasons = r.reasons if batch else () if values else (NEVER_UPDATED,)
            found.append({**start, **cells, "reasons": "; ".join(reasons), **tracking})
    return found
