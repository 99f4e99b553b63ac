"""Stop a run after a signal such as Ctrl-C, the stop key, or a request of the live page."""

from __future__ import annotations

import contextlib
import math
import os
import select
import signal
import sys
import threading
from types import FrameType
from typing import Any, Self

from drivers.posix import posix_module
from teleop.interruption import Interruption
from teleop.safety import Fault, Request
from teleop.safety.channels import DetectedFault
from teleop.safety.state import NO_REQUEST
from teleop.station.station import Station
from teleop.trial.page_requests import NoPage

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
        termios = posix_module("termios")
        assert termios
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
        termios = posix_module("termios")
        assert termios
        before = termios.tcgetattr(self._descriptor)
        modes = [*before[:6], [*before[6]]]
        modes[3] &= ~(termios.ICANON | termios.ECHO)
        modes[6][termios.VMIN], modes[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._descriptor, termios.TCSANOW, modes)
        self._before = self._before or before

    def _restore_modes(self) -> None:
        termios = posix_module("termios")
        if termios and self._before:
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
    if posix_module("termios") is None:
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


ARM = Request(arm=True)
"""Request to arm the drives."""
KEY = DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)
"""Fault that is reported when the stop key is pressed."""
RAMP = "Ctrl-C ramps the drives down and ends the trial"
"""Instruction about Ctrl-C."""
RESPONSE_TIME = 0.1
"""Time within which a running control loop responds to a signal [s]."""


class NoStation:
    """Replacement for a `Station` in a trial on one computer."""

    arms = True
    """Whether the other station permits to arm the drives."""
    armed = False
    """Whether the drives of this station have been armed."""
    reason = ""
    """Reason why the other station ends the run; empty if it does not."""
    faults: tuple[DetectedFault, ...] = ()
    """Faults that the other station causes here."""

    def read(self, consent: bool, ending: bool) -> None:
        """Do nothing. In `Station`, this method reads what the other station has sent."""


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
    station
        The session with the other one of two stations.
    explained
        The parameter `explained`.
    """

    def __init__(self, key: bool = False, explained: bool = False) -> None:
        super().__init__()
        self.explained = explained
        self._use_key = key
        self.key = StopKey()
        self.page = NoPage()
        self.station: NoStation | Station = NoStation()

    @property
    def arms(self) -> bool:
        """Whether the live page and the other station permit to arm the drives."""
        return self.page.arms and self.station.arms

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
        """Whether a signal, the live page, or the loss of the terminal ended the run.

        It is also True if the other station ended before the drives were armed.
        """
        never_armed = bool(self.station.reason) and not self.station.armed
        return self.signalled or bool(self.page.reason) or never_armed

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
        key, page, station = self.key, self.page, self.station
        page.read()
        reason = self.reason or key.lost or page.reason or end
        station.read(page.arms, bool(reason))
        reason, arm = reason or station.reason, arm and page.arms and station.arms
        faults = page.faults + station.faults
        if not (reason or key.pressed or faults):
            return ARM if arm else NO_REQUEST
        self.acknowledge()
        faults = (KEY, *faults) if key.pressed else faults
        return Request(arm, reason, self.count > 1, faults)
