"""How a person stops a run: Ctrl-C, a request to end, and the Enter key as an emergency stop."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import sys
import threading
from types import FrameType
from typing import Any, Self

from teleop.safety import Fault, Request
from teleop.safety.channels import Trip
from teleop.safety.state import NO_REQUEST

ARM = Request(arm=True)
KEY = Trip(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)

SIGNALS = {"SIGINT": "Ctrl-C", "SIGTERM": "asked to end", "SIGHUP": "the terminal was closed"}
"""Signals that end a run in good order; one more of them ends it at once."""


class StopSwitch:
    """Turns signals and the Enter key into requests to the safety supervisor.

    Used as a context manager about a run, whose signals it takes meanwhile. Python hands signals
    to the main thread alone: elsewhere the switch has none.

    Parameters
    ----------
    key
        Whether the Enter key of the terminal is an emergency stop.
    """

    def __init__(self, key: bool = False) -> None:
        self._key = key
        self._before: dict[signal.Signals, Any] = {}
        self._asked = 0
        self._reason = ""
        self._pressed = False

    @property
    def interrupted(self) -> bool:
        """Whether a person ended the run."""
        return self._asked > 0

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in SIGNALS:
                if number := getattr(signal.Signals, name, None):
                    self._before[number] = signal.signal(number, self._on_signal)
        if self._key and is_foreground():
            if hasattr(signal, "SIGTTIN"):
                self._before[signal.SIGTTIN] = signal.signal(signal.SIGTTIN, signal.SIG_IGN)
            threading.Thread(target=self._await_key, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def request(self, arm: bool, end: str = "") -> Request:
        """What the person wants at a tick.

        Parameters
        ----------
        arm
            Whether the drives are still to be armed.
        end
            Why the run is to end by itself; empty to go on.
        """
        if not (end or self._asked or self._pressed):
            return ARM if arm else NO_REQUEST
        trips = (KEY,) if self._pressed else ()
        return Request(arm, self._reason or end, self._asked > 1, trips)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self._reason = SIGNALS[signal.Signals(number).name]
        self._asked += 1

    def _await_key(self) -> None:
        """Sleep until a line comes from the terminal, which ends with the Enter key."""
        with contextlib.suppress(OSError):
            if os.read(sys.stdin.fileno(), 1024):
                self._pressed = True


def is_foreground() -> bool:
    """Whether standard input is a terminal from which this process may read."""
    try:
        descriptor = sys.stdin.fileno()
        if not os.isatty(descriptor):
            return False
        return not hasattr(os, "tcgetpgrp") or os.tcgetpgrp(descriptor) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        return False
