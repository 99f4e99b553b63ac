"""Collect the results of several recordings, to compare them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from estimation.quantities import RESULTS, STIFFNESS
from estimation.summary import EstimatorSummary
from teleop.errors import InputError
from teleop.evaluation.across.means import Value
from teleop.evaluation.batch.kinds import kinds_of_estimates
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.evaluation import Evaluation
from teleop.evaluation.teleoperation.tracking import COLUMNS, Tracking

NO_LEVEL = "-"
"""Level of a factor (see `Compared.factors`) that is not known for a recording."""
RESULT = "result"
"""Name of the method that gives the batch result. The other methods are the estimators."""
OF_RESULT = ("k", "b")
"""Symbols of the quantities of a result."""
NEVER_UPDATED = "the estimator was never updated: no contact or no motion"
SUBJECT = "subject"
"""Name of the random factor. Its levels are persons or specimens, as a sample of all of them."""
BODY = ("specimen", "cube")
"""Names of the factors that name the palpated body."""
REPETITIONS = ("repetition", "n", "rep", "repeat", "replicate", "trial")
"""Names of the factor that numbers the repetitions."""


@dataclass(frozen=True)
class Compared:
    """Results of one recording, to compare it with other recordings."""

    file: str
    """Name of the file."""
    factors: dict[str, str]
    """Level of each factor that is known for the recording, by the name of the factor. A factor is
    a property in which recordings differ, for example `condition` with the level `mimic`."""
    result: StiffnessResult
    """Stiffness and damping with their intervals, or the reasons why there are none."""
    estimates: dict[str, EstimatorSummary]
    """Averages of the estimates over the record, by the name of the estimator."""
    tracking: Tracking | None = None
    """Gain, phase and error of the slave relative to the target of `mimic`; None without a
    target."""
    force_lag: float = 0.0
    """Time constant of the force channel that is compensated in the result [s]."""
    lost_motion: float = 0.0
    """Lost motion between encoder and tip that is compensated in the result [m]."""

    def levels(self, by: Sequence[str]) -> tuple[str, ...]:
        """Return the level of this recording for each factor in `by`; `NO_LEVEL` if it is unknown.

        A factor is a property in which recordings differ, for example `condition`. Its level is the
        value for one recording, for example `mimic`.
        """
        return tuple(self.factors.get(name, NO_LEVEL) for name in by)


def compared(
    file: str,
    factors: Mapping[str, str],
    evaluation: Evaluation,
    tracking: Tracking | None = None,
) -> Compared:
    """Return the results of one recording in the form that comparisons need."""
    analysis = evaluation.analysis
    return Compared(
        file,
        dict(factors),
        analysis.result,
        evaluation.summaries(),
        tracking,
        analysis.record.force_lag,
        analysis.transmission.lost_motion,
    )


def values_of(row: Compared, method: str) -> dict[str, Value]:
    """Return k, b and e_f of one method for one recording, by these symbols.

    k is the stiffness, b the damping, and e_f the force error. e_f exists for estimators only. A
    quantity that the data of the recording do not determine is left out.
    """
    if method != RESULT:
        one = row.estimates.get(method)
        if one is None:
            return {}
        return {
            symbol: Value(getattr(one, symbol), math.nan, kind)
            for symbol, kind in kinds_of_estimates(one.further).items()
            if math.isfinite(getattr(one, symbol))
        }
    result = row.result
    if not result.identifiable:
        return {}
    found = {}
    for symbol, kind in result.kinds.items():
        if result.determines(symbol):
            low, high = result.interval(symbol)
            found[symbol] = Value(getattr(result, symbol), 0.5 * (high - low), kind)
    return found


def check_factors(rows: Sequence[Compared], by: Sequence[str]) -> None:
    """Check that each factor in `by` is known for at least one recording.

    A factor is a property in which recordings differ, for example `condition`.
    """
    known = dict.fromkeys(name for row in rows for name in row.factors)
    for name in by:
        if name not in known:
            raise InputError(f"factor {name!r}: expected one of {', '.join(known)}")


def tidy_rows(
    rows: Iterable[Compared], factors: Sequence[str], of_estimators: bool = False
) -> list[dict[str, Any]]:
    """Return the rows of a table with one row for each recording.

    The row contains k and b of the batch evaluation, with their 95 % intervals. With
    `of_estimators`, there is instead one row for each recording and online estimator, which
    contains the averages of its estimates over the record.
    """
    found = []
    for row in rows:
        start = {"file": row.file, **dict(zip(factors, row.levels(factors), strict=True))}
        tracking = {text: getattr(row.tracking, key, None) for key, text in COLUMNS.items()}
        r = row.result
        for method in row.estimates if of_estimators else (RESULT,):
            values = values_of(row, method)
            batch = method == RESULT
            cells: dict[str, Any] = {"method": method}
            for symbol in OF_RESULT:
                kind = values[symbol].kind if symbol in values else None
                cells[f"kind of {symbol}"] = kind
            cells["at force [N]"] = r.force if batch else None
            cells["at depth [m]"] = r.depth if batch else None
            cells["depth from"] = r.depth_from if batch and r.depth is not None else None
            cells["b at frequency [Hz]"] = r.damping_at_hz if batch else None
            tip = r.k_tip if batch else None
            for end in ("value", "low", "high"):
                name = f"k at the tip{'' if end == 'value' else f' {end}'} [{STIFFNESS.si}]"
                cells[name] = getattr(tip, end) if tip else None
            cells["compensated force lag [s]"] = row.force_lag
            cells["compensated lost motion [m]"] = row.lost_motion
            for symbol, quantity in RESULTS.items():
                cells[quantity.column] = values[symbol].value if symbol in values else None
                for end in ("low", "high") if symbol != "e_f" else ():
                    value = getattr(r, f"{symbol}_{end}") if batch and symbol in values else None
                    cells[f"{symbol} {end} [{quantity.si}]"] = value
            cells["b cannot be used because"] = r.b_reason if batch else None
            reasons = r.reasons if batch else () if values else (NEVER_UPDATED,)
            found.append({**start, **cells, "reasons": "; ".join(reasons), **tracking})
    return found
