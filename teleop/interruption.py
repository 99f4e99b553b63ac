"""Handle the signals that end a program: SIGINT (Ctrl-C), SIGTERM, SIGHUP and SIGQUIT."""

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
    """Call a function for each signal of `SIGNALS` that arrives within a `with` block.

    A signal that is ignored before the block remains ignored. For example, `nohup` makes a process
    ignore SIGHUP, and a process that a shell script starts with `&` ignores SIGINT. In a thread
    other than the main thread, `handle_signals` has no effect, because Python delivers signals only
    to the main thread.

    Parameters
    ----------
    handler
        Function that is called when a signal arrives. Its argument is the text of the signal in
        `SIGNALS`, such as "Ctrl-C".
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

    This class is a context manager, which handles the signals of `SIGNALS` within a `with` block.
    When the program responds to a signal, it calls `acknowledge`. It must do so within the time
    `timeout`. Otherwise, the next signal that arrives after this time raises KeyboardInterrupt. In
    the following `CLEAN_UP` seconds, the program can clean up, and no further signal interrupts it.

    Attributes
    ----------
    count
        Number of signals that have arrived.
    reason
        Text of the latest signal in `SIGNALS`, such as "Ctrl-C"; empty before the first signal.
    ends_program
        Whether a signal other than Ctrl-C has arrived. It asks the whole program to end. In a
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
        """Store that the program responds to all signals that have arrived so far.

        The program calls this method when it begins to stop.
        """
        self._unacknowledged_since = math.inf

    def clean_up(self) -> None:
        """Permit the program to clean up: for `CLEAN_UP` seconds, no signal interrupts it.

        The program calls this method before it cleans up.
        """
        self.timeout = CLEAN_UP
        self._unacknowledged_since = time.monotonic()

    def on_signal(self, reason: str) -> None:
        """Count a signal, and interrupt the program if it does not respond to signals.

        Parameters
        ----------
        reason
            Text of the signal, which is a value of `SIGNALS`.

        Raises
        ------
        KeyboardInterrupt
            The program has not called `acknowledge` within the time `timeout` after a signal.
        """
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
    """Handle the signals of `SIGNALS` within a `with` block.

    Yields
    ------
    Function that returns whether a signal has arrived since the start of the block.
    """
    came = threading.Event()
    with handle_signals(lambda reason: came.set()):
        yield came.is_set
