"""The signals that end a program: SIGINT (Ctrl-C), SIGTERM, SIGHUP and SIGQUIT."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Self

SIGNALS = {
    "SIGINT": "Ctrl-C",
    "SIGTERM": "asked to end",
    "SIGHUP": "the terminal was closed",
    "SIGQUIT": "Ctrl-\\",
}
"""Reported reason for each signal that ends a program. Windows has only the first two signals."""
CLEAN_UP = 2.0
"""Time for which no signal interrupts the clean-up of a program [s]."""


@contextlib.contextmanager
def handle_signals(handler: Callable[[str], object]) -> Iterator[None]:
    """Call `handler` with the text of each signal of `SIGNALS` that arrives within the block.

    A signal that is ignored before the block remains ignored: `nohup` makes a process ignore
    SIGHUP, and a process that a shell script starts with `&` ignores SIGINT. In a thread other than
    the main thread there is no effect, because Python delivers signals only to the main thread.
    """

    def on_signal(number: int, frame: FrameType | None) -> None:
        handler(SIGNALS[signal.Signals(number).name])

    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in SIGNALS:
            number = getattr(signal, name, None)
            if number and signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.signal(number, on_signal)
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


class Interruption:
    """Counts the signals that end a program, and interrupts the program if it does not respond.

    The signals are handled within a `with` block. When the program responds to a signal, it calls
    `acknowledge` within the time `timeout`. Otherwise, the next signal after this time raises
    KeyboardInterrupt. In the following `CLEAN_UP` seconds, no further signal interrupts it.

    Attributes
    ----------
    count
        Number of signals that have arrived.
    reason
        Text of the latest signal in `SIGNALS`; empty before the first signal.
    ends_program
        Whether a signal other than Ctrl-C has arrived, which asks the whole program to end. In a
        series, Ctrl-C asks only the present trial to end.
    timeout
        Time within which the program must call `acknowledge` after a signal [s]. With the initial
        value 0, a signal raises KeyboardInterrupt immediately.
    """

    def __init__(self) -> None:
        self.count = 0
        self.reason = ""
        self.ends_program = False
        self.timeout = 0.0
        self._unacknowledged_since = math.inf
        self._handled = contextlib.ExitStack()

    def acknowledge(self) -> None:
        """Store that the program responds to all signals so far: it begins to stop."""
        self._unacknowledged_since = math.inf

    def clean_up(self) -> None:
        """Let no signal interrupt the program for `CLEAN_UP` seconds, in which it cleans up."""
        self.timeout = CLEAN_UP
        self._unacknowledged_since = time.monotonic()

    def on_signal(self, reason: str) -> None:
        """Count a signal; KeyboardInterrupt if an earlier one was not acknowledged in time."""
        self.count += 1
        self.reason = reason
        self.ends_program = self.ends_program or reason != SIGNALS["SIGINT"]
        now = time.monotonic()
        self._unacknowledged_since = min(self._unacknowledged_since, now)
        if now - self._unacknowledged_since >= self.timeout:
            self.clean_up()
            raise KeyboardInterrupt(reason)

    def __enter__(self) -> Self:
        self._handled.enter_context(handle_signals(self.on_signal))
        return self

    def __exit__(self, *_: object) -> None:
        self._handled.close()


@contextlib.contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Handle the signals within a block; the yielded function tells whether one has arrived."""
    came = threading.Event()
    with handle_signals(lambda reason: came.set()):
        yield came.is_set
