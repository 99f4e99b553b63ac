"""Settings of a station: which side of the telemanipulator this computer has."""

from __future__ import annotations

import math
from dataclasses import dataclass

from teleop.names import RecordedSideName


@dataclass(frozen=True)
class StationSettings:
    """Side of the telemanipulator that this computer has, and what it does after a silence.

    Raises
    ------
    ValueError
        A value is out of its range.
    """

    side: RecordedSideName
    """The side of this computer: master (the handle) or slave (the tool). In a recording that
    `teleop merge` has written: both."""
    max_silence: float = 0.1
    """Longest permitted time without data of the other station [s]. After this time, the drives are
    stopped."""
    retreat: float = 0.0
    """Distance by which the slave moves out of the specimen after a silence, before it stops [m]; 0
    to stop where it is."""
    session: str = ""
    """Number of the session, which the recordings of both stations have."""

    def __post_init__(self) -> None:
        if not 0.0 < self.max_silence <= 1.0:
            raise ValueError(
                f"max_silence must be more than 0 and at most 1 s, got {self.max_silence:g} s"
            )
        if not 0.0 <= self.retreat < math.inf:
            raise ValueError(f"retreat must be >= 0 and finite, got {self.retreat:g} m")
        if self.retreat and self.side == "master":
            raise ValueError("retreat: only the slave retreats: expected it at the slave station")
