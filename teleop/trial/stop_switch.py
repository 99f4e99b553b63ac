"""Combine signals, the stop key, and requests of the live page into the stop switch of a run."""

from __future__ import annotations

import contextlib
import math

from teleop.interruption import Interruption
from teleop.safety import Fault, Request
from teleop.safety.channels import DetectedFault
from teleop.safety.state import NO_REQUEST
from teleop.trial.page_requests import NoPage
from teleop.trial.stop_key import StopKey

ARM = Request(arm=True)
"""Request to arm the drives."""
KEY = DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)
"""Fault that is reported when the stop key is pressed."""
RAMP = "Ctrl-C ramps the drives down and ends the trial"
"""Instruction about Ctrl-C."""
RESPONSE_TIME = 0.1
"""Time within which a running control loop responds to a signal [s]."""


class StopSwitch(Interruption):
    """Converts signals, the stop key and the live page to requests to the safety supervisor.

    This is a context manager for a run, including the output of the results. Before the first tick
    of the loop, nothing moves, and a signal raises KeyboardInterrupt. After the first tick, a
    signal becomes a request to the supervisor. If the loop does not respond to this request, the
    next signal raises KeyboardInterrupt.

    Parameters
    ----------
    key
        Whether Enter or Space in the terminal is an emergency stop.
    explained
        Whether the instructions were shown to a person before the drives were armed.

    Attributes
    ----------
    page
        Requests of the live page.
    explained
        See the parameter.
    """

    def __init__(self, key: bool = False, explained: bool = False) -> None:
        super().__init__()
        self.explained = explained
        self._use_key = key
        self.key = StopKey()
        self.page = NoPage()

    @property
    def interrupted(self) -> bool:
        """Whether a signal, the live page, or the loss of the terminal ended the run."""
        return self.count > 0 or bool(self.key.lost or self.page.reason)

    @property
    def _has_key(self) -> bool:
        return self._use_key and not self.key.missing

    @property
    def hint(self) -> str:
        """Text about the keys that stop the run, for the progress line."""
        return "Enter stops" if self._has_key else "Ctrl-C stops"

    @property
    def instructions(self) -> str:
        """One line of text that describes how to stop the run."""
        if self._has_key:
            return f"Enter or Space stops at once, {RAMP}"
        no_key = f"; no stop key: {self.key.missing}" if self.key.missing else ""
        return f"{RAMP}, Ctrl-C twice stops at once{no_key}"

    def reading_keys(self) -> StopKey | contextlib.AbstractContextManager[None]:
        """Return a context manager within which the stop key is read."""
        return self.key if self._use_key else contextlib.nullcontext()

    def request(self, arm: bool, end: str = "") -> Request:
        """Return the request to the supervisor at a tick.

        Parameters
        ----------
        arm
            Whether to request that the drives are armed.
        end
            Reason why the run ends without a request of a person; empty if the run continues.
        """
        self.timeout = RESPONSE_TIME
        key, page = self.key, self.page
        page.read()
        reason, arm = self.reason or key.lost or page.reason or end, arm and page.arms
        if not (reason or key.pressed or page.faults):
            return ARM if arm else NO_REQUEST
        self.acknowledge()
        faults = (KEY, *page.faults) if key.pressed else page.faults
        return Request(arm, reason, self.count > 1, faults)
