"""The progress line: it shows time, mode and present estimates on a terminal during a trial."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

from teleop.live.cue import LEGEND, Cue
from teleop.live.terminal import Terminal

REDRAW, REDRAW_CUE = 0.1, 0.03
"""Time between two updates of the line, without and with a target that the operator follows [s]."""
SHOWN = 4
"""Largest number of estimators whose estimates the line shows."""
STDERR = 2
"""File descriptor of standard error."""


class Status(NamedTuple):
    """Data that the progress line shows in addition to the time."""

    mode: str
    """Mode of the safety supervisor."""
    target: float
    """Position of the target that the operator follows [m]; NaN for none."""
    position: float
    """Position of the slave [m]."""
    estimates: Iterable[tuple[str, float, float]]
    """Name of each estimator, with its estimates of damping b [N s/m] and stiffness k [N/m]."""


class Progress:
    """The progress line on standard error.

    Parameters
    ----------
    shown
        Whether to show the line. `report` writes its messages in either case.
    duration
        Duration of the trial [s].
    hint
        Keys that stop the trial; the line shows them.
    instructions
        Text that explains how to stop the trial; written once at the start.
    cue
        Bar that shows the target of the condition mimic; None for another condition.
    """

    def __init__(
        self,
        shown: bool,
        duration: float,
        hint: str,
        instructions: str,
        cue: Cue | None = None,
    ) -> None:
        self._shown = shown
        self._duration = duration
        self._hint = f"[{hint}]  " if hint else ""
        self._cue = cue
        self._due = 0.0
        self._terminal = Terminal(STDERR)
        if shown and instructions:
            self.report(f"teleop: {instructions}" + (f"; {LEGEND}" if cue else ""))

    def show(self, t: float, status: Callable[[], Status]) -> None:
        """Update the line, unless the latest update was a short time ago.

        Parameters
        ----------
        t
            Time of the trial [s]; negative before the drives may be armed.
        status
            Function that returns the data to show. It is called only if the line is updated.
        """
        now = time.monotonic()
        if not self._shown or now < self._due:
            return
        self._due = now + (REDRAW_CUE if self._cue else REDRAW)
        mode, target, position, estimates = status()
        texts = [f"  {name} {k:6.0f} {b:+5.0f}" for name, b, k in estimates if not math.isnan(k)]
        shown = f"  k [N/m], b [N s/m]:{''.join(texts[:SHOWN])}" if texts else ""
        progress = f"{self._hint}{mode}  {max(t, 0.0):4.1f} of {self._duration:g} s"
        cue = f"  {self._cue.text(t, target, position)}" if self._cue else ""
        self._draw(f"{progress}{cue}{shown}")

    def report(self, text: str) -> None:
        """Write a message on a line of its own, which remains on the terminal."""
        self._terminal.write(("\r\x1b[K" if self._shown else "") + text + "\n")

    def close(self) -> None:
        """Clear the line. If the terminal is stopped (Ctrl-S), the line may remain."""
        if self._shown:
            self._terminal.draw("\r\x1b[K")
        self._terminal.close()

    def _draw(self, text: str) -> None:
        try:
            width = os.get_terminal_size(STDERR).columns or 80
        except OSError:
            self._shown = False
            return
        self._terminal.draw("\r" + text[: width - 1] + "\x1b[K")
