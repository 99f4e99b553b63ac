"""Decide while a trial runs whether the estimates of k and b can be used."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.expected_intervals import LARGEST_EXPECTED
from estimation.misfit import LARGEST_MISFIT
from estimation.play_bank import HALF_WIDTHS, IndicatedPlay, indicated_play
from estimation.play_bank import WINDOW as PLAY_WINDOW
from estimation.quantities import DAMPING
from teleop.live.history import MOST_ROWS

WINDOW = 1.0
"""Length of the time window that is judged [s]: one period of the palpation. Interval and misfit
are the largest in this window, so that an estimate that is good for a moment is not supported. The
other values are medians."""
JUDGED = int(max(WINDOW, PLAY_WINDOW) * MOST_ROWS) + 1
"""Number of rows from which k and b are judged: lost motion is indicated by a longer window."""
PERIOD = 0.5
"""Time between two decisions [s], so that a person can read the marks."""
WIDEST = {"k": 0.1, "b": 0.5}
"""Largest half width of the 95 % interval, as a fraction of the value. The damping of soft bodies
is a small part of the force, and its interval is wider than that of k."""
LARGEST_SHIFT = 0.5
"""Largest effect of force lag and lost motion on b, as a fraction of b."""
LEAST_CHANGE = 0.1
"""Least change of k or b by indicated lost motion that is stated, as a fraction of the value. A
change within the 95 % interval is not stated either."""
USABLE, NOT_YET, UNUSABLE = "can be used", "not yet", "cannot"
"""The marks. With `NOT_YET`, more motion can help; with `UNUSABLE`, it cannot."""
PARTS = ("k", "b")


class Verdict(NamedTuple):
    """Whether one estimate can be used, and why."""

    mark: str
    reason: str
    width: float
    """Half width of the 95 % interval, as a fraction of the value; infinite if not known."""


class Shared(NamedTuple):
    """What the decisions on all estimators of a trial have in common."""

    contact: float
    """Share of the samples in contact; NaN if contact is not detected."""
    expected: Mapping[str, float]
    """Half widths of the 95 % intervals of k and b that motion and noise permit, as fractions."""
    moves_b: float | None
    """Time constant [s]: lag and lost motion reduce b by k times this time; None if unknown."""
    cause: str
    """Which of lag and lost motion are known."""
    play: IndicatedPlay | None
    """Lost motion that the force indicates, beyond that which is removed from the position."""


class Trust:
    """Decides whether k and b can be used, from the latest rows of the live page.

    `columns` are the names of the values of a row. `transmission` has the lag of the force that is
    not compensated, `force_lag` [s], and the half width of the play, `lost_motion` [m]; it is None
    if they are unknown. `removed` is the half width of the play that is removed from the position
    before the estimates [m]. `document` is the present decision, for the message `state`.
    """

    def __init__(
        self,
        columns: Sequence[str],
        estimators: Sequence[str],
        transmission: Mapping[str, float] | None,
        removed: float = 0.0,
    ) -> None:
        self._place = {name: i for i, name in enumerate(columns)}
        self._estimators = estimators
        self._transmission, self._removed = transmission, removed
        self._at = -math.inf
        nothing = Verdict(NOT_YET, "no estimate yet", math.inf)
        self.document = self._document([dict.fromkeys(PARTS, nothing) for _ in estimators])

    def is_due(self, t: float) -> bool:
        """Return whether `PERIOD` has passed at time `t` [s] since the last decision."""
        return bool(self._estimators) and not 0.0 <= t - self._at < PERIOD

    def update(self, rows: Floats) -> None:
        """Decide again from the latest rows (`JUDGED`), if a decision is due."""
        t = rows[:, self._place["time"]] if self._place else rows[:0, 0]
        if not len(t) or not self.is_due(t[-1]):
            return
        self._at = float(t[-1])
        play = self._play(rows[t > t[-1] - PLAY_WINDOW])
        rows = rows[t > t[-1] - WINDOW]
        shared = self._shared(rows)._replace(play=play)
        self.document = self._document([self._verdicts(n, rows, shared) for n in self._estimators])

    def _known(self, rows: Floats, name: str) -> Floats:
        """Return the values of a column that are not NaN; an empty array without this column."""
        values = rows[:, self._place[name]] if name in self._place else rows[:0, 0]
        return values[~np.isnan(values)]

    def _median(self, rows: Floats, name: str) -> float:
        values = self._known(rows, name)
        return float(np.median(values)) if len(values) else math.nan

    def _largest(self, rows: Floats, name: str) -> float:
        values = self._known(rows, name)
        return float(np.max(values)) if len(values) else math.nan

    def _shared(self, rows: Floats) -> Shared:
        contact = self._median(rows, "contact")
        expected = {part: self._median(rows, f"{part}_bound") for part in PARTS}
        if self._transmission is None:
            return Shared(contact, expected, None, "", None)
        lag, lost = (self._transmission[name] for name in ("force_lag", "lost_motion"))
        speeds = np.abs(self._known(rows, "v"))
        # As in `TransmissionCalibration.damping_error`: mean |v| / mean v^2.
        square = float(np.mean(speeds**2)) if len(speeds) else 0.0
        per_speed = float(np.mean(speeds)) / square if square > 0.0 else 0.0
        cause = ", ".join(name for name, value in (("lag", lag), ("lost motion", lost)) if value)
        return Shared(contact, expected, lag + lost * per_speed, cause, None)

    def _play(self, rows: Floats) -> IndicatedPlay | None:
        """Return the lost motion that the force indicates; None without strong evidence."""
        names = ("time", "slave_position", "contact_force")
        if not all(name in self._place for name in names):
            return None
        t, x, f = (rows[:, self._place[name]] for name in names)
        # NaN, if contact is not detected, is treated as contact
        contact = rows[:, self._place["contact"]] != 0.0 if "contact" in self._place else f == f
        return indicated_play(t, x, f, contact, self._removed)

    def _verdicts(self, name: str, rows: Floats, shared: Shared) -> dict[str, Verdict]:
        """Return the decisions on k and b of one estimator."""
        of = {part: self._median(rows, f"{name}_{part}") for part in ("k", "b", "held")}
        of["misfit"] = self._largest(rows, f"{name}_misfit")
        found = {}
        for part in PARTS:
            half = LEVEL_95 * self._largest(rows, f"{name}_{part}_std")
            width = half / abs(of[part]) if of[part] else math.inf
            shift = self._moved(of, shared) if part == "b" else ""
            shift = shift or self._behind_play(part, of[part], half, shared.play)
            if part == "b" and shared.moves_b is None:
                shift = shift or "force lag not measured"
            mark, reason = judge(part, width, of, shared, shift)
            found[part] = Verdict(mark, reason, math.inf if math.isnan(width) else width)
        return found

    @staticmethod
    def _moved(of: Mapping[str, float], shared: Shared) -> str:
        """Return why b is wrong because of lag or lost motion; empty if the effect is small."""
        shift = of["k"] * (shared.moves_b or 0.0)
        if not abs(shift) > LARGEST_SHIFT * abs(of["b"]):
            return ""
        sign = "-" if shift > 0.0 else "+"
        return f"{shared.cause}: {sign}{DAMPING.shown(abs(shift)):.0f} {DAMPING.unit}"

    def _behind_play(self, part: str, value: float, half: float, play: IndicatedPlay | None) -> str:
        """Return the indicated lost motion; empty if it changes the estimate only a little.

        `half` is the half width of the 95 % interval of the estimate; NaN if it is not known.
        """
        change = 0.0 if play is None else abs(play.k_change if part == "k" else play.b_change)
        if play is None or not change > LEAST_CHANGE * abs(value) or change <= half:
            return ""
        found = f"{play.half_width * 1e3:.2g}"
        if self._removed:
            return f"lost motion {found}, not {self._removed * 1e3:.2g} mm"
        if play.half_width == HALF_WIDTHS[-1]:
            return f"lost motion ≥ {found} mm"
        return f"lost motion ≈ {found} mm"

    def _document(self, verdicts: Sequence[Mapping[str, Verdict]]) -> dict[str, Any]:
        """Return the mark of k and of b, and which estimates of each estimator are supported.

        The mark is that of the estimator that can be used and has the narrowest interval. If none
        can be used, it is that of the estimator with the narrowest interval.
        """
        marks = {}
        for part in PARTS if verdicts else ():
            every = [one[part] for one in verdicts]
            best = min(range(len(every)), key=lambda i: (every[i].mark != USABLE, every[i].width))
            mark, reason, _ = every[best]
            if any(one.reason != reason for one in every):
                reason = f"{reason} ({self._estimators[best]})"
            marks[part] = {"mark": mark, "reason": reason}
        supported = [{part: one[part].mark == USABLE for part in PARTS} for one in verdicts]
        return {**marks, "supported": supported}


def judge(
    part: str, width: float, of: Mapping[str, float], shared: Shared, shift: str
) -> tuple[str, str]:
    """Return the mark of one estimate, and the reason in a few words.

    `part` is k or b, `width` the half width of its interval as a fraction of its value, and `of`
    has the values k, b, held and misfit of the estimator. `shift` states that lag or lost motion
    make the estimate wrong; it is empty if they do not.
    """
    if shared.contact < 0.5:
        return NOT_YET, "no contact"
    if math.isnan(of[part]):
        return NOT_YET, "no estimate yet"
    if not shared.expected[part] <= LARGEST_EXPECTED:
        return NOT_YET, f"motion does not determine {part}"
    if of["held"] > 0.5:
        return NOT_YET, "estimate held"
    if shift:
        return UNUSABLE, shift
    if math.isnan(width):
        return UNUSABLE, "no interval"
    if width > WIDEST[part]:
        return NOT_YET, f"interval {percent(width)}"
    if math.isnan(of["misfit"]):
        return NOT_YET, "misfit not known yet"
    if of["misfit"] > LARGEST_MISFIT:
        return UNUSABLE, f"misfit up to {100.0 * of['misfit']:.0f} %"
    if of[part] < 0.0:
        return UNUSABLE, f"{part} is negative"
    return USABLE, percent(width)


def percent(width: float) -> str:
    """Return the relative half width of an interval as text."""
    if width > 1.0:
        return "± >100 %"
    return f"± {100.0 * width:.{0 if width >= 0.1 else 1}f} %"
