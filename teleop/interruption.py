"""Ctrl-C, SIGTERM and SIGHUP of commands that are no trial; a trial has its stop switch."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator

ENDING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
"""The signals by which a person or the system ends a program; Windows has no SIGHUP."""


@contextlib.contextmanager
def handled(handler: Callable[..., object]) -> Iterator[None]:
    """The signals of `ENDING` go to a handler within the block."""
    before = {number: signal.signal(number, handler) for number in ENDING}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


@contextlib.contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Whether one came."""
    came = threading.Event()
    with handled(lambda *_: came.set()):
        yield came.is_set


def interrupted(*_: object) -> None:
    """End as on Ctrl-C."""
    raise KeyboardInterrupt


@contextlib.contextmanager
def in_good_order() -> Iterator[None]:
    """Each of them ends the block as Ctrl-C does, so that a rig is idled and closed."""
    with handled(interrupted):
        yield
