"""The progress line: time and present estimates, shown on a terminal while a trial runs."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence

from teleop.live.terminal import Terminal

REDRAW = 0.1
"""Time between two drawings of the line [s]."""
SHOWN = 4
"""Largest number of estimators on the line."""
STDERR = 2
"""File descriptor of standard error."""

Estimates = Sequence[tuple[str, float, float, float]] | None
"""Name, b [N s/m], k [N/m] and misfit of each estimator; None if there is no contact."""


class Progress:
    """The progress line on standard error.

    Parameters
    ----------
    shown
        Whether to show the line. Messages of `report` are written in any case.
    duration
        Duration of the trial [s].
    hint
        Keys that stop the run, shown in the line.
    instructions
        How to stop the run, for a line at the start.
    largest_misfit
        Misfit above which an estimator is marked.
    """

    def __init__(
        self, shown: bool, duration: float, hint: str, instructions: str, largest_misfit: float
    ) -> None:
        self._shown = shown
        self._duration = duration
        self._hint = f"[{hint}]  " if hint else ""
        self._largest_misfit = largest_misfit
        self._due = 0.0
        self._terminal = Terminal(STDERR)
        if shown and instructions:
            self.report(f"teleop: {instructions}")

    def show(self, t: float, estimates: Callable[[], Estimates]) -> None:
        """Update the line if `REDRAW` has passed since the last update.

        Parameters
        ----------
        t
            Time of the trial [s].
        estimates
            Returns the present estimates; called only if the line is updated.
        """
        now = time.monotonic()
        if not self._shown or now < self._due or t < 0.0:
            return
        self._due = now + REDRAW
        progress = f"{self._hint}{t:4.1f} of {self._duration:g} s"
        present = estimates()
        if present is None:
            self._draw(f"{progress}  no contact")
            return
        shown = present[:SHOWN]
        marked = [misfit > self._largest_misfit for *_, misfit in shown]
        texts = [
            f"  {name} {k:6.0f} {b:+5.0f}{'*' if mark else ''}"
            for (name, b, k, _), mark in zip(shown, marked, strict=True)
        ]
        note = ", * misfit" if any(marked) else ""
        self._draw(f"{progress}  k [N/m], b [N s/m]{note}:{''.join(texts)}")

    def report(self, text: str) -> None:
        """Write a message that stays on the terminal."""
        self._terminal.write(("\r\x1b[K" if self._shown else "") + text + "\n")

    def close(self) -> None:
        """Clear the line, unless the terminal is stopped."""
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
