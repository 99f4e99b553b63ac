"""Stop a run after a signal such as Ctrl-C, the stop key, or a request of the live page."""

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
    """Means by which a person stops a run: signals such as Ctrl-C, the stop key, and the live page.

    All three cause a request to the safety supervisor, which stops the drives. The stop key is
    Enter or Space in the terminal.

    This class is a context manager for the whole run, including the output of the results. Before
    the first tick, nothing moves. A signal then raises KeyboardInterrupt. From the first tick on, a
    signal becomes a request to the supervisor. If the loop does not respond within `RESPONSE_TIME`,
    the next signal raises KeyboardInterrupt.

    Attributes
    ----------
    key
        The `StopKey`, which reads the keys. It is used only if the parameter `key` is True.
    page
        Requests of the live page.
    explained
        The parameter `explained`.
    """

    def __init__(self, key: bool = False, explained: bool = False) -> None:
        super().__init__()
        self.explained = explained
        self._use_key = key
        self.key = StopKey()
        self.page = NoPage()

    @property
    def signalled(self) -> bool:
        """Whether a signal such as Ctrl-C arrived, or the terminal was lost."""
        return self.count > 0 or bool(self.key.lost)

    @property
    def ends_command(self) -> bool:
        """Whether the command must end, and not only the trial: see `Interruption.ends_program`."""
        return self.ends_program or bool(self.key.lost)

    @property
    def interrupted(self) -> bool:
        """Whether a signal, the live page, or the loss of the terminal ended the run."""
        return self.signalled or bool(self.page.reason)

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
        """Return a context manager. The stop key (Enter or Space) is read within its `with` block.

        If the run has no stop key, the context manager has no effect.
        """
        return self.key if self._use_key else contextlib.nullcontext()

    def request(self, arm: bool, end: str = "") -> Request:
        """Return the request to the safety supervisor at a tick."""
        self.timeout = RESPONSE_TIME
        key, page = self.key, self.page
        page.read()
        reason, arm = self.reason or key.lost or page.reason or end, arm and page.arms
        if not (reason or key.pressed or page.faults):
            return ARM if arm else NO_REQUEST
        self.acknowledge()
        faults = (KEY, *page.faults) if key.pressed else page.faults
        return Request(arm, reason, self.count > 1, faults)
