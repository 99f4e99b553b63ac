"""Find the moving part of a record, and the datum (the zero of position and force)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.evaluation.batch.contact_phases import Phases, find_phases
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.formats.units import quantity
from teleop.evaluation.reading.signals import Signals


class Datum(NamedTuple):
    """Position and force that are treated as zero, in the coordinates of the file."""

    x: float
    """Position [m]."""
    f: float
    """Force [N]."""
    source: str
    """Text that describes how the datum was chosen."""


OWN_ZERO = Datum(0.0, 0.0, "the file's own zero")
FIRST, GIVEN = "the first sample", "given"
CHOSEN = (OWN_ZERO.source, FIRST, GIVEN)
"""Values of `Datum.source` of a datum that the user has chosen."""


def find_datum(signals: Signals, wanted: str, phases: Phases | None = None) -> Datum:
    """Return the datum: the position and the force that are treated as zero.

    The parameter `wanted` selects the datum. It is one of these words:

    - `contact`: the contact point and the force out of contact.
    - `mean`: the mean position and the mean force of the moving part. The force of a preloaded
      specimen is approximately linear about the mean position.
    - `auto`: as `contact` if the record has a contact point, otherwise as `mean`.
    - `file`: the zero of the file.
    - `start`: position and force of the first sample.

    Instead of a word, `wanted` can also state a position and a force, such as `1.5mm,20N`.
    """
    if wanted in ("auto", "contact"):
        if phases is None:
            phases = find_phases(smoothed_signals(signals))
        point, level = phases.contact_point, phases.free_force
        if point is not None and level is not None:
            half = 0.5 * (point.high - point.low)
            return Datum(point.value, level, f"the contact point, \u00b1 {half * 1e3:.2g} mm")
        if wanted == "contact":
            raise InputError(
                "datum contact: the record has no begin of contact after free motion: expected "
                "auto, file, start, mean, or a position and a force"
            )
        wanted = "mean"
    if wanted == "file":
        return OWN_ZERO
    if wanted == "start":
        return Datum(float(signals.x[0]), float(signals.f[0]), FIRST)
    if wanted == "mean":
        motion = moving_part(signals.x)
        return Datum(
            float(signals.x[motion].mean()),
            float(signals.f[motion].mean()),
            "mean of the motion",
        )
    position, _, force = wanted.partition(",")
    x, f = quantity(position, "position"), quantity(force, "force")
    if x is None or f is None:
        raise InputError(
            f"datum {wanted!r}: expected auto, contact, file, start, mean, or a position and "
            "a force with units such as 1.5mm,20N"
        )
    return Datum(x, f, GIVEN)


def moving_part(x: Floats) -> slice:
    """Return the part of the record without the rest at its beginning and the rest at its end.

    The rest at the beginning lasts until the position differs from the first position by more than
    2 % of the range of the positions. The rest at the end begins when the position differs from the
    last position for the last time by more than the same limit. The range is the 99th minus the 1st
    percentile, so that a single outlier does not change it.
    """
    if np.ptp(x) == 0.0:
        raise InputError("nothing moves: the position is the same in every sample")
    band = 0.02 * float(np.subtract(*np.percentile(x, [99.0, 1.0])) or np.ptp(x))
    first = int(np.argmax(np.abs(x - x[0]) > band))
    last = len(x) - int(np.argmax(np.abs(x[::-1] - x[-1]) > band))
    return slice(max(first - 1, 0), min(last + 1, len(x))) if first < last else slice(None)
