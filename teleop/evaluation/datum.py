"""Find the moving part of a record, and the zero of position and force (the datum)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.phases import Phases, find_phases
from teleop.evaluation.prepared import prepare
from teleop.evaluation.signals import Signals
from teleop.evaluation.units import quantity


class Datum(NamedTuple):
    """Position and force that are treated as zero, in the coordinates of the file."""

    x: float
    """Position [m]."""
    f: float
    """Force [N]."""
    source: str
    """Text that describes how the datum was chosen."""


OWN_ZERO = Datum(0.0, 0.0, "the file's own zero")


def find_datum(signals: Signals, wanted: str, phases: Phases | None = None) -> Datum:
    """Return the position and force that are treated as zero.

    `wanted` is one of these, or states a position and a force:

    - `contact`: the contact point and the force out of contact.
    - `mean`: the mean of the moving part. The force of a preloaded specimen is approximately linear
      about the mean position.
    - `auto`: as `contact` if the record has a contact point, otherwise as `mean`.
    - `file`: the zero of the file.
    - `start`: the first sample.

    The names of the columns do not influence the choice.

    Parameters
    ----------
    signals
        The record.
    wanted
        `auto`, `contact`, `file`, `start`, `mean`, or a position and a force.
    phases
        Phases of the record. If they are None, they are computed when they are needed.

    Raises
    ------
    InputError
        `wanted` is none of the permitted values, or there is no contact point.
    """
    if wanted in ("auto", "contact"):
        if phases is None:
            phases = find_phases(prepare(signals))
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
        return Datum(float(signals.x[0]), float(signals.f[0]), "the first sample")
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
    return Datum(x, f, "given")


def moving_part(x: Floats) -> slice:
    """Return the part of the record between the rest at the beginning and the rest at the end.

    A rest ends when the position differs from the rest position by more than 2 % of the range. The
    range is the difference between the 99th and the 1st percentile, so that a single outlier does
    not change it.

    Raises
    ------
    InputError
        The position is the same in every sample.
    """
    if np.ptp(x) == 0.0:
        raise InputError("nothing moves: the position is the same in every sample")
    band = 0.02 * float(np.subtract(*np.percentile(x, [99.0, 1.0])) or np.ptp(x))
    first = int(np.argmax(np.abs(x - x[0]) > band))
    last = len(x) - int(np.argmax(np.abs(x[::-1] - x[-1]) > band))
    return slice(max(first - 1, 0), min(last + 1, len(x))) if first < last else slice(None)
