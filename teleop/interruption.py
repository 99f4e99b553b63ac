"""Ctrl-C, SIGTERM, SIGHUP and SIGQUIT: the signals that ask a program to end."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Self

ENDING = {
    "SIGINT": "Ctrl-C",
    "SIGTERM": "asked to end",
    "SIGHUP": "the terminal was closed",
    "SIGQUIT": "Ctrl-\\",
}
"""The signals and their reasons; Windows has the first two."""
CLEAN_UP = 2.0
"""Time that a program has to end by itself after it was interrupted [s]."""


@contextlib.contextmanager
def handled(handler: Callable[[str], object]) -> Iterator[None]:
    """Give the signals of `ENDING` to a handler within the block.

    A signal that is ignored on entry stays ignored: `nohup` ignores SIGHUP, and a shell script
    ignores SIGINT of the processes that it starts with `&`. Python delivers signals to the main
    thread alone: in another thread nothing is changed.

    Parameters
    ----------
    handler
        Called with the reason.
    """

    def on_signal(number: int, frame: FrameType | None) -> None:
        handler(ENDING[signal.Signals(number).name])

    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in ENDING:
            number = getattr(signal, name, None)
            if number and signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.signal(number, on_signal)
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


class Interruption:
    """Counts the signals that ask to end, and raises KeyboardInterrupt if nobody answers them.

    Used as a context manager, within which it handles the signals. A signal raises
    KeyboardInterrupt if it, or one before it, was not answered for `patience`. The clean-up that
    follows has `CLEAN_UP` before another signal can break it off.

    Attributes
    ----------
    count
        How many signals have come.
    reason
        What the latest one means; empty before the first.
    patience
        How long a signal may wait for an answer [s]. With 0, as at first, each raises at once.
    """

    def __init__(self) -> None:
        self.count = 0
        self.reason = ""
        self.patience = 0.0
        self._waits_since = math.inf
        self._handled = contextlib.ExitStack()

    def answer(self) -> None:
        """Tell that the program acts on the signals that have come."""
        self._waits_since = math.inf

    def clean_up(self) -> None:
        """Give the program `CLEAN_UP` from now on to end by itself."""
        self.patience = CLEAN_UP
        self._waits_since = time.monotonic()

    def on_signal(self, reason: str) -> None:
        """Handle a signal."""
        self.count += 1
        self.reason = reason
        now = time.monotonic()
        self._waits_since = min(self._waits_since, now)
        if now - self._waits_since >= self.patience:
            self.clean_up()
            raise KeyboardInterrupt(reason)

    def __enter__(self) -> Self:
        self._handled.enter_context(handled(self.on_signal))
        return self

    def __exit__(self, *_: object) -> None:
        self._handled.close()


@contextlib.contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Give a function that returns whether a signal came within the block."""
    came = threading.Event()
    with handled(lambda reason: came.set()):
        yield came.is_set
