"""Result of the check of a drive, with a remark if its travel differs from the commanded travel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

LARGEST_DEVIATION = 0.05
"""Largest deviation of measured from commanded travel for which there is no remark, as a fraction
of the commanded travel.

If the scale is wrong by this fraction, the error of k is as large as the 95 % interval of a good
estimate. The travel of emulated drives without lost motion deviates by at most half of this
fraction.
"""


class Stroke(NamedTuple):
    """Travel of a drive in the first half of a stroke (test motion in one direction and back)."""

    commanded: float
    """Commanded travel [m], > 0."""
    moved: float
    """Travel that the encoder measured [m], positive in the direction of the stroke. NaN if the
    drive has no encoder."""
    explained: float
    """Largest difference between commanded and measured travel that encoder resolution and drive
    compliance can cause [m]."""

    @property
    def lost(self) -> float:
        """Commanded minus measured travel [m]; NaN if the drive has no encoder."""
        return self.commanded - self.moved


class DriveReport(NamedTuple):
    """Result of the check of one drive: watchdog time, travel, and a problem, if any."""

    name: str
    """Name of the drive, `master` or `slave`."""
    watchdog_s: float
    """Time from the last command until the watchdog stopped the drive [s].

    NaN if the watchdog did not stop the drive.
    """
    commanded_m: float
    """Commanded travel of the longest stroke [m]; NaN if the drive was not moved."""
    moved_m: float
    """Measured travel of the longest stroke [m].

    NaN if the drive was not moved or has no encoder.
    """
    ratio: float
    """Measured travel divided by commanded travel in the longest stroke; NaN if not known."""
    problem: str
    """Problem of the drive; empty if there is no problem."""
    remark: str
    """Remark on `ratio` if it differs too much from 1; otherwise empty."""


def drive_report(
    name: str,
    watchdog: float,
    strokes: Sequence[Stroke],
    problem: str,
    coupled: bool = False,
    reports_watchdog: bool = True,
) -> DriveReport:
    """Return the result of the check of one drive.

    `coupled` states whether its axis follows the velocity through a virtual coupling.
    """
    remarks = [] if problem else [remark(name, strokes, coupled)]
    if not reports_watchdog:
        remarks.append(
            "does not report its watchdog: test it by hand: unplug the bus while the drive exerts "
            "a force"
        )
    longest = strokes[-1] if strokes else Stroke(math.nan, math.nan, math.nan)
    return DriveReport(
        name,
        watchdog,
        longest.commanded,
        longest.moved,
        longest.moved / longest.commanded,
        problem,
        "; ".join(filter(None, remarks)),
    )


def remark(name: str, strokes: Sequence[Stroke], coupled: bool = False) -> str:
    """Return a text if the measured travel differs too much from the commanded travel.

    The text is empty if the difference is small. Otherwise, the text states a likely cause. To find
    it, the loss (commanded minus measured travel) is compared for the two longest strokes. If the
    loss is almost equal in both, the likely cause is lost motion or friction. In all other cases,
    for example if the loss increases with the length of the stroke, it is a wrong scale.
    """
    if not strokes or not abs(strokes[-1].lost) > (
        LARGEST_DEVIATION * strokes[-1].commanded + strokes[-1].explained
    ):
        return ""
    longest = strokes[-1]
    text = (
        f"moved {longest.moved / longest.commanded:.0%} of the commanded travel, "
        f"{longest.lost * 1e3:.3f} mm less: expected {1.0 - LARGEST_DEVIATION:.0%} to "
        f"{1.0 + LARGEST_DEVIATION:.0%}: "
    )
    if coupled and longest.lost < 0.0:  # an oscillation on the spring of the coupling
        return ""
    if coupled:
        return (
            f"{text}friction of the moving part or a hand that holds it stretches the coupling; "
            "otherwise, check that the motor exerts its force"
        )
    scale = f"check the scales of drives.{name} and of channels.{name}_position"
    if len(strokes) < 2 or longest.lost < 0.0:
        return text + scale
    before = strokes[-2]
    growth = (longest.lost - before.lost) / (longest.commanded - before.commanded)
    if abs(growth) <= LARGEST_DEVIATION:
        return (
            f"{text}a stroke of half the length lost {before.lost * 1e3:.3f} mm, so that lost "
            "motion or friction of the drive is the likely cause; it lowers the estimate of b"
        )
    return f"{text}the loss grows with the length of the stroke: {scale}"
