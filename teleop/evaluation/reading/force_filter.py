"""Compensate the delay of a machine's force filter, if the measurement file states the filter.

Far below the cutoff frequency, a low-pass filter delays the force and does not change its
amplitude. A Butterworth filter of order n and cutoff frequency fc has the delay 1 / (2 pi fc sin(pi
/ 2n)). For n = 3 and a signal frequency of fc / 10, the delay differs from this value by 0.2 %, and
the amplitude changes by less than 0.01 %. A delay of the force decreases the estimated damping by k
times the delay.

References
----------
A. V. Oppenheim, R. W. Schafer, "Discrete-Time Signal Processing", 3rd ed., Pearson, 2010,
appendix B (Butterworth filters).
"""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.reason import Reason

ORDER = re.compile(
    r"(?P<word>first|second|third|fourth|fifth|sixth)[- ]order"
    r"|(?P<ordinal>\d)\s*(?:st|nd|rd|th|\.)[- ]?\s*(?:order|ordnung)"
    r"|order[ :=]*(?P<number>\d)|(?P<poles>\d)[- ]?poles?",
    re.IGNORECASE,
)
WORDS = ("first", "second", "third", "fourth", "fifth", "sixth")
CUTOFF = re.compile(
    r"(?P<number>\d+(?:[.,]\d+)?)\s*(?P<kilo>k?)Hz"
    r"|\((?P<unit>k?)Hz\)\s*[:=]?\s*(?P<after>\d+(?:[.,]\d+)?)",
    re.IGNORECASE,
)
NOT_BUTTERWORTH = re.compile(
    r"notch|high[- ]?pass|band|bessel|chebyshev|moving|median", re.IGNORECASE
)
WITHOUT_DELAY = re.compile(r"zero[- ]?phase|filtfilt", re.IGNORECASE)


class Compensated(NamedTuple):
    """Signals after the compensation of the filter delay of the force, and a note for the user."""

    signals: Signals
    """The signals; the measured signals if there is no delay, or if it is not known."""
    note: Reason | None
    """How the delay was compensated, or why it was not; None if no filter with delay is stated."""


def stated_delay(text: str) -> float | None:
    """Return the delay [s] of the low-pass filter that a text describes; None if it is not known.

    A filter whose type is not stated is treated as a Butterworth filter. The delay of a zero-phase
    filter is 0.
    """
    if WITHOUT_DELAY.search(text):
        return 0.0
    cutoffs, orders = list(CUTOFF.finditer(text)), list(ORDER.finditer(text))
    if len(cutoffs) != 1 or len(orders) != 1 or NOT_BUTTERWORTH.search(text):
        return None
    number, kilo, unit, after = cutoffs[0].groups()
    number, kilo = number or after, kilo or unit
    cutoff = float(number.replace(",", ".")) * (1000.0 if kilo else 1.0)
    named = {kind: value for kind, value in orders[0].groupdict().items() if value}
    kind, value = named.popitem()
    order = WORDS.index(value.lower()) + 1 if kind == "word" else int(value)
    if order < 1 or cutoff <= 0.0:
        return None
    return 1.0 / (2.0 * math.pi * cutoff * math.sin(0.5 * math.pi / order))


def without_filter_delay(signals: Signals) -> Compensated:
    """Compensate the delay of the force filter that the measurement file states.

    The force is shifted to earlier times by the delay. If the file states no filter, or if the
    delay is zero or not known, the signals are not changed.
    """
    stated = signals.force_filter
    if not stated:
        return Compensated(signals, None)
    delay = stated_delay(stated)
    if delay is None:
        return Compensated(
            signals,
            Reason(
                f"the file states a filter of the force, {stated!r}, whose delay is not known: b "
                "is too low by k times the delay",
                "--force-lag gives the delay (0 if there is none)",
            ),
        )
    if delay == 0.0:
        return Compensated(signals, None)
    return Compensated(
        advanced(signals, delay)._replace(filter_delay=delay),
        Reason(
            f"the force is advanced by {delay * 1e3:.3g} ms, the delay of the filter that the file "
            f"states ({stated!r})",
            "--force-lag gives another delay of the filter, 0 for none",
        ),
    )


def advanced(signals: Signals, delay: float) -> Signals:
    """Return the signals with the force shifted to earlier times by `delay` [s].

    The force at the time t + `delay` is computed by a cubic spline, and becomes the force at the
    time t. If there is a gap or the end of the record between t and t + `delay`, the sample is
    omitted. If fewer than two samples would remain, the signals are returned unchanged.
    """
    from scipy.interpolate import CubicSpline  # most files state no filter

    t, x, f = signals.t, signals.x, signals.f.copy()
    kept = np.ones(len(t), dtype=np.bool_)
    for start, end in pairwise(sorted({0, len(t), *signals.gaps})):
        kept[start:end] = (t[start:end] <= t[end - 1] - delay) & (end - start > 3)
        if end - start > 3:
            f[start:end] = CubicSpline(t[start:end], signals.f[start:end])(t[start:end] + delay)
    if kept.sum() < 2:
        return signals
    begins = [start for start in (0, *signals.gaps) if kept[start:].any()]
    indices = np.cumsum(kept) - 1
    firsts = {int(indices[begin + int(np.argmax(kept[begin:]))]) for begin in begins}
    return signals._replace(
        t=t[kept],
        x=x[kept],
        f=f[kept],
        dt=periods(t[kept]),
        gaps=tuple(sorted(firsts - {0})),
    )
