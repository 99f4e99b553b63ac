"""How a person stops a run: Ctrl-C, a request to end, and the emergency-stop key."""

from __future__ import annotations

import contextlib
import math

from teleop.interruption import Interruption
from teleop.safety import Fault, Request
from teleop.safety.channels import DetectedFault
from teleop.safety.state import NO_REQUEST
from teleop.trial.stop_key import StopKey

ARM = Request(arm=True)
KEY = DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)
ANSWER = 0.1
"""Time in which a loop that runs answers a signal [s]."""


class StopSwitch(Interruption):
    """Turns signals and the stop key into requests to the safety supervisor.

    Used as a context manager about a run and what is printed of it. Before the loop's first tick a
    signal raises KeyboardInterrupt: nothing moves yet. From then on it is a request to the
    supervisor, and raises KeyboardInterrupt only if the loop hangs.

    Parameters
    ----------
    key
        Whether Enter and Space in the terminal are an emergency stop.
    """

    def __init__(self, key: bool = False) -> None:
        super().__init__()
        self._wants_key = key
        self.key = StopKey()

    @property
    def interrupted(self) -> bool:
        """Whether a person ended the run."""
        return self.count > 0 or bool(self.key.lost)

    @property
    def _has_key(self) -> bool:
        return self._wants_key and not self.key.missing

    @property
    def hint(self) -> str:
        """How to stop the run, in two words."""
        return "Enter stops" if self._has_key else "Ctrl-C stops"

    @property
    def instructions(self) -> str:
        """How to stop the run, in a line."""
        if self._has_key:
            return "Enter or Space stops at once, Ctrl-C ramps down"
        why = f"; no stop key: {self.key.missing}" if self.key.missing else ""
        return f"Ctrl-C ramps down, Ctrl-C twice stops at once{why}"

    def attended(self) -> StopKey | contextlib.AbstractContextManager[None]:
        """A context in which the key acts."""
        return self.key if self._wants_key else contextlib.nullcontext()

    def request(self, arm: bool, end: str = "") -> Request:
        """What the person wants at a tick.

        Parameters
        ----------
        arm
            Whether the drives are still to be armed.
        end
            Why the run is to end by itself; empty to go on.
        """
        self.patience = ANSWER
        reason, key = self.reason or self.key.lost or end, self.key
        if not (reason or key.pressed):
            return ARM if arm else NO_REQUEST
        self.answer()
        return Request(arm, reason, self.count > 1, (KEY,) if key.pressed else ())
