"""Evaluate the record of a running trial again and again, until it is as precise as wanted.

The evaluation is that after the trial. The interval of an online estimator can be narrow although
its value is wrong.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.expected_intervals import half_width_text
from teleop.control.wanted_precision import REACHED, WantedPrecision, parse_wanted
from teleop.errors import InputError
from teleop.evaluation.batch.analysis import Analysis
from teleop.evaluation.evaluate import batch_analysis
from teleop.evaluation.reading.recorded import Sections, measured, with_gaps
from teleop.evaluation.reading.signals import Signals
from teleop.recording.recording import Recording, from_columns
from teleop.streams.columns import Schema
from teleop.trial.recorded_trial import estimate_settings

FIRST, PERIOD, GROWTH = 1.0, 0.5, 0.05
"""Time of the first evaluation after arming [s], time between two evaluations [s], and the least
time between two evaluations as a fraction of the time since arming, for long trials."""
CONFIRM = 0.2
"""Time from the first evaluation with the wanted precision to the one that confirms it [s]. The
interval of one of many evaluations can be too narrow by chance."""
NOT_KNOWN = "not known yet"
REMEMBERED, FEWEST = 8, 5
"""Largest number of evaluations from which the limit of a half width is estimated, and least."""


class Finding(NamedTuple):
    """Precision at one evaluation of a running trial."""

    text: str
    """The half widths of the intervals, and how much longer the trial takes."""
    is_reached: bool


class PrecisionWatch:
    """Evaluates the record of a running trial, and compares its precision with the wanted one.

    `trial` has the settings, the names of the columns and the events of the trial, but no ticks.
    """

    def __init__(self, wanted: WantedPrecision, trial: Recording, duration: float) -> None:
        self._wanted = wanted
        self._settings = estimate_settings(trial)
        self._armed = next(e["time"] for e in trial.events if e["mode"] == "active")
        self._limit = duration
        self._sections = Sections()
        self._gap_ends: list[float] = []
        self._due = self._armed + FIRST
        self._is_confirmed = False
        self._reached = False
        self._history: deque[tuple[float, dict[str, float]]] = deque(maxlen=REMEMBERED)

    def add(self, columns: Mapping[str, Floats], is_after_gap: bool = False) -> None:
        """Add the columns of the next ticks, before which ticks can be missing."""
        if is_after_gap:
            self._gap_ends.append(float(columns["time"][0]))
        self._sections.add(measured(columns))

    def is_due(self, t: float) -> bool:
        """Return whether the record must be evaluated at the time t [s] of the trial."""
        return t >= self._due and not self._reached

    def evaluate(self, t: float) -> Finding:
        """Evaluate all ticks that were added, until the time t [s] of the trial."""
        elapsed = t - self._armed
        try:
            analysis = batch_analysis(self._signals(), self._settings)
        except InputError:
            analysis = None
        halves = {part: half_width(analysis, part) for part in self._wanted.parts}
        text = ", ".join(f"{part} {half_width_text(half)}" for part, half in halves.items())
        is_precise = all(halves[part] <= most for part, most in self._wanted.parts.items())
        if is_precise and self._is_confirmed:
            self._reached = True
            return Finding(f"{REACHED}: {text} after {elapsed:.1f} s", True)
        self._is_confirmed = is_precise
        self._due = t + (CONFIRM if is_precise else max(PERIOD, GROWTH * elapsed))
        self._history.append((elapsed, halves))
        if is_precise:
            more = "to be confirmed"
        else:
            left = self._limit - elapsed
            more = forecast(analysis, self._history, self._wanted, left)
        return Finding(f"{text}: {more}", False)

    def _signals(self) -> Signals:
        t, x, f, dt = self._sections.samples()
        gaps = with_gaps(t, dt, self._gap_ends, self._sections.starts)
        return Signals(t, x, f, dt, "slave_position", gaps)


def watch_of(session: Mapping[str, Any], schema: Schema, event: dict[str, Any]) -> PrecisionWatch:
    """Return the evaluation of a trial whose drives were armed at this event."""
    columns = {column.name: np.empty(0) for column in schema.columns}
    trial = from_columns(schema, columns, [event], session["metadata"])
    return PrecisionWatch(parse_wanted(session["wanted"]), trial, session["duration"])


def half_width(analysis: Analysis | None, part: str) -> float:
    """Return the half width of the interval of k or b as a fraction of the value.

    NaN if the evaluation does not give the value, or states that it cannot be used.
    """
    result = analysis and analysis.result
    if not result or not result.determines(part) or (part == "b" and result.b_reason):
        return math.nan
    low, high = result.interval(part)
    value = abs(getattr(result, part))
    return 0.5 * (high - low) / value if value else math.inf


def forecast(
    analysis: Analysis | None,
    history: Sequence[tuple[float, Mapping[str, float]]],
    wanted: WantedPrecision,
    left: float,
) -> str:
    """Return how long the same motion takes until the wanted precision, as text.

    The part of an interval that results from noise decreases with the square root of the time. The
    part of the errors of lag and lost motion between encoder and tip, and of the choice of the
    model, does not decrease.

    `history` has the times since arming [s] and the half widths of the latest evaluations, and
    `left` is the time until the time limit [s].
    """
    elapsed, halves = history[-1]
    times = []
    for part, most in wanted.parts.items():
        half, least = halves[part], permanent(analysis, part)
        if math.isnan(half):
            return NOT_KNOWN
        if least >= most:
            return (
                f"not reachable by this motion, lag and lost motion alone give {part} "
                f"{half_width_text(least)}"
            )
        approached = max(least, limit_of([(t, one[part]) for t, one in history]))
        if approached >= most:
            return f"not expected with this motion, {part} approaches {half_width_text(approached)}"
        noise = max(half**2 - approached**2, 0.0)
        times.append(elapsed * (noise / (most**2 - approached**2) - 1.0))
    more = max(*times, 0.1)
    beyond = f", and {max(left, 0.0):.2g} s are left" if more > left else ""
    return f"about {more:.2g} s more{beyond}"


def limit_of(history: Sequence[tuple[float, float]]) -> float:
    """Return the half width that the evaluations approach: h^2 = a / t + c with c >= 0.

    The result is 0 if there are fewer than `FEWEST` evaluations with a half width.
    """
    known = np.array([(1.0 / t, half**2) for t, half in history if math.isfinite(half)])
    if len(known) < FEWEST:
        return 0.0
    _, limit = np.polyfit(known[:, 0], known[:, 1], 1)
    return math.sqrt(min(max(float(limit), 0.0), float(known[-1, 1])))


def permanent(analysis: Analysis | None, part: str) -> float:
    """Return the part of a relative half width that a longer record does not reduce."""
    if analysis is None or analysis.result.k is None or analysis.result.b is None:
        return 0.0
    record, known = analysis.record, analysis.transmission
    usable = analysis.phases.usable
    x, v = record.x[usable], record.v[usable]
    power = float((v**2).mean())
    if not power > 0.0:
        return 0.0
    a = np.gradient(record.v, record.period)[usable]
    omega = float(a.std()) / math.sqrt(power)
    k, b = analysis.result.k, analysis.result.b
    if part == "k":
        return known.stiffness_error(k, 0.5 * float(np.ptp(x)), omega) / abs(k)
    return known.damping_error(k, float(np.abs(v).mean()) / power, omega) / abs(b) if b else 0.0
