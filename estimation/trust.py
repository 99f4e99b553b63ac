"""Define the marks that state whether an estimate of k or b can be used."""

from __future__ import annotations

USABLE, NOT_YET, UNUSABLE = "can be used", "not yet", "cannot"
"""The marks. With `NOT_YET`, more motion can help; with `UNUSABLE`, it cannot."""
WIDEST = {"k": 0.1, "b": 0.5}
"""Largest half width of the 95 % interval, as a fraction of the value. The damping of soft bodies
is a small part of the force, and its interval is wider than that of k."""
LARGEST_SHIFT = 0.5
"""Largest effect of force lag and lost motion on b, as a fraction of b."""


def percent(width: float) -> str:
    """Return the relative half width of an interval as text."""
    if width > 1.0:
        return "± >100 %"
    if width < 0.0005:
        return "± <0.1 %"
    return f"± {100.0 * width:.{0 if width >= 0.1 else 1}f} %"
