"""Read the emergency-stop key, which is Enter or Space in the terminal, during a run."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import threading
from importlib.util import find_spec
from types import FrameType
from typing import Any, Self

KEYS = b"\r\n "
"""Codes of Enter and Space."""
NAP = 0.2
"""Time between two attempts to read a terminal that cannot be read at present [s]."""
IN_BACKGROUND = (
    "\nteleop: in the background: the stop key does not work until the run is in the foreground\n"
)
"""Message that is printed when the process continues in the background."""


class StopKey:
    """Emergency-stop key. A thread reads the keys of the terminal from standard input.

    This is a context manager for a run. It must be entered in the main thread. Within the block,
    the terminal passes each key to the process immediately and does not show the key.
    Ctrl-C and Ctrl-Z have their usual effect. The modes of the terminal are restored on exit, and
    while the process is suspended.

    Attributes
    ----------
    pressed
        Whether Enter or Space was pressed.
    lost
        Reason why the keys can no longer be read; empty while they can be read.
    missing
        Reason why the emergency-stop key cannot be used; empty if it can be used.
    """

    def __init__(self) -> None:
        self.pressed = False
        self.lost = ""
        self.missing = unavailable()
        self._undo = contextlib.ExitStack()
        self._descriptor = -1
        self._before: list[Any] | None = None
        """Modes of the terminal before the run; None if they have been restored."""

    def __enter__(self) -> Self:
        if self.missing:
            return self
        import termios

        self._descriptor = sys.stdin.fileno()
        with contextlib.ExitStack() as undo:
            handlers: dict[signal.Signals, Any] = {
                signal.SIGTTIN: signal.SIG_IGN,
                signal.SIGTTOU: signal.SIG_IGN,
                signal.SIGTSTP: self._on_suspend,
                signal.SIGCONT: self._on_continue,
            }
            for number, handler in handlers.items():
                before = signal.getsignal(number)
                if before is not signal.SIG_IGN:
                    undo.callback(signal.signal, number, before)
                    signal.signal(number, handler)
            undo.callback(self._restore_modes)
            try:
                self._set_key_mode()
            except termios.error as error:
                self.missing = str(error.args[-1]).lower()
                return self
            ended, end = os.pipe()
            thread = threading.Thread(target=self._watch, args=(ended,), daemon=True)
            undo.callback(os.close, ended)
            undo.callback(thread.join, 1.0)
            undo.callback(os.close, end)
            thread.start()
            self._undo = undo.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._undo.close()

    def _set_key_mode(self) -> None:
        """Set the terminal to pass each key to the process immediately, without showing the key."""
        import termios

        before = termios.tcgetattr(self._descriptor)
        modes = [*before[:6], [*before[6]]]
        modes[3] &= ~(termios.ICANON | termios.ECHO)
        modes[6][termios.VMIN], modes[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._descriptor, termios.TCSANOW, modes)
        self._before = self._before or before

    def _restore_modes(self) -> None:
        import termios

        if self._before:
            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)
        self._before = None

    def _on_suspend(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal of Ctrl-Z: restore the modes of the terminal, and suspend the process.

        When the process continues, keys are read again. The system does not suspend the process if
        no shell could continue it. The parameters are those of every signal handler in Python.
        They are not used.
        """
        self._restore_modes()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self._on_suspend)
        self._on_continue()

    def _on_continue(self, *_: object) -> None:
        """Resume reading keys after the process was suspended.

        If the process is in the background, keys cannot be read. A message about this is then
        written to standard error.
        """
        if is_foreground():
            self._set_key_mode()
        else:
            with contextlib.suppress(OSError):
                os.write(2, IN_BACKGROUND.encode())

    def _watch(self, ended: int) -> None:
        """Read keys until the end of the run, and set `pressed` after Enter or Space.

        `ended` is the file descriptor of a pipe. The other end of the pipe is closed at the end of
        the run.

        Ctrl-D has no special meaning. While the process is in the background, or after another
        program has changed the modes of the terminal, a read fails or returns no data. The read is
        then repeated. If standard input is no longer a terminal, the reading ends, and `lost`
        contains the reason.
        """
        while not self.lost:
            try:
                if ended in select.select([self._descriptor, ended], [], [])[0]:
                    return
                keys = os.read(self._descriptor, 1024)
            except (OSError, ValueError):
                keys = b""
            if any(key in KEYS for key in keys):
                self.pressed = True
            elif not keys:
                if not os.isatty(self._descriptor):
                    self.lost = "the terminal of the stop key was lost"
                elif select.select([ended], [], [], NAP)[0]:
                    return


def unavailable() -> str:
    """Return the reason why the emergency-stop key cannot be used; empty if it can be used."""
    if find_spec("termios") is None:
        return "not available on this system"
    if not is_foreground():
        return "standard input is not a terminal of this process"
    if threading.current_thread() is not threading.main_thread():
        return "not the main thread"
    return ""


def is_foreground() -> bool:
    """Return whether standard input is a terminal from which this process may read."""
    try:
        descriptor = sys.stdin.fileno()
        if not os.isatty(descriptor):
            return False
        return not hasattr(os, "tcgetpgrp") or os.tcgetpgrp(descriptor) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        return False
