"""Handling of the signals that end a program: SIGINT (Ctrl-C), SIGTERM, SIGHUP and SIGQUIT."""

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
"""Reason that is reported for each signal that ends a program; Windows has the first two only."""
CLEAN_UP = 2.0
"""Time for the clean-up after an interruption, before another signal can interrupt it [s]."""


@contextlib.contextmanager
def handle_signals(handler: Callable[[str], object]) -> Iterator[None]:
    """Call a handler for the signals of `SIGNALS` within the block.

    A signal that is ignored on entry stays ignored: `nohup` ignores SIGHUP, and a shell script
    ignores SIGINT in the processes that it starts with `&`. In a thread other than the main
    thread nothing is changed, because Python delivers signals to the main thread only.

    Parameters
    ----------
    handler
        Called with the reason of the signal.
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
    """Counts the signals of `SIGNALS`, and raises KeyboardInterrupt if they are not acknowledged.

    Used as a context manager, within which it handles the signals. A signal raises
    KeyboardInterrupt if it, or an earlier one, was not acknowledged within `timeout`. The
    clean-up that follows then has the time `CLEAN_UP` before another signal can interrupt it.

    Attributes
    ----------
    count
        Number of signals so far.
    reason
        Reason of the latest signal; empty before the first.
    timeout
        Time in which a signal has to be acknowledged [s]. With the initial value 0, each signal
        raises KeyboardInterrupt immediately.
    """

    def __init__(self) -> None:
        self.count = 0
        self.reason = ""
        self.timeout = 0.0
        self._unacknowledged_since = math.inf
        self._handled = contextlib.ExitStack()

    def acknowledge(self) -> None:
        """Report that the program responds to the signals so far."""
        self._unacknowledged_since = math.inf

    def clean_up(self) -> None:
        """Start the clean-up: a signal does not interrupt it within `CLEAN_UP` from now."""
        self.timeout = CLEAN_UP
        self._unacknowledged_since = time.monotonic()

    def on_signal(self, reason: str) -> None:
        """Count a signal.

        Raises
        ------
        KeyboardInterrupt
            A signal was not acknowledged within `timeout`.
        """
        self.count += 1
        self.reason = reason
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
    """Yield a function that returns whether a signal has arrived within the block."""
    came = threading.Event()
    with handle_signals(lambda reason: came.set()):
        yield came.is_set
