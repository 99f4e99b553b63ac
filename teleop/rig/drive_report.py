"""Result of the check of a drive, and the remark on travel that is shorter than commanded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

LARGEST_DEVIATION = 0.05
"""Largest deviation of measured from commanded travel without a remark, relative to the latter.

A wrong scale of this size changes k as much as the 95 % interval of a good estimate. The emulated
drives without lost motion differ by at most half of it.
"""


class Stroke(NamedTuple):
    """Travel of a drive in one stroke."""

    commanded: float
    """Commanded travel [m], > 0."""
    moved: float
    """Travel that the encoder measured, in the direction of the stroke [m]; NaN for no encoder."""
    explained: float
    """Difference that the encoder's resolution and the compliance of the drive explain [m]."""

    @property
    def lost(self) -> float:
        """Commanded minus measured travel [m]."""
        return self.commanded - self.moved


class DriveReport(NamedTuple):
    """Result of the check of one drive."""

    name: str
    """Name of the drive, `master` or `slave`."""
    watchdog_s: float
    """Time from the last command until the watchdog stopped the drive [s].

    NaN if the watchdog did not stop the drive.
    """
    commanded_m: float
    """Commanded travel of the longest stroke [m]; NaN if the drive was not moved."""
    moved_m: float
    """Travel of the longest stroke that the encoder measured [m].

    NaN if the drive was not moved or has no encoder.
    """
    ratio: float
    """Measured over commanded travel of the longest stroke; NaN if one of them is not known."""
    problem: str
    """Problem of the drive; empty if there is none."""
    remark: str
    """Remark on a ratio that differs from 1; empty if there is none."""


def drive_report(
    name: str, watchdog: float, strokes: Sequence[Stroke], problem: str
) -> DriveReport:
    """Return the result of the check of one drive.

    Parameters
    ----------
    name
        Name of the drive.
    watchdog
        Time until the watchdog stopped the drive [s]; NaN if it did not.
    strokes
        Strokes of the drive, from the shortest to the longest.
    problem
        Problem of the drive; empty for none.
    """
    longest = strokes[-1] if strokes else Stroke(math.nan, math.nan, math.nan)
    return DriveReport(
        name,
        watchdog,
        longest.commanded,
        longest.moved,
        longest.moved / longest.commanded,
        problem,
        "" if problem else remark(name, strokes),
    )


def remark(name: str, strokes: Sequence[Stroke]) -> str:
    """Return a remark if the measured travel differs from the commanded travel; empty if not.

    If the travel is lost at the reversal, the loss is the same in a longer stroke, and if a scale
    is wrong, it is proportional to the stroke. The two longest strokes are compared.

    Parameters
    ----------
    name
        Name of the drive.
    strokes
        Strokes of the drive, from the shortest to the longest.
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
