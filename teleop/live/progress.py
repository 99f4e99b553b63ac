"""The progress line, which shows time, mode and present estimates during a trial.

The line is shown on a terminal, or in the output of a notebook.
"""

from __future__ import annotations

import math
import os
import textwrap
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from estimation.quantities import DAMPING, STIFFNESS
from teleop.live.cue import LEGEND, Cue
from teleop.live.terminal import Terminal

REDRAW, REDRAW_CUE, REDRAW_PLAIN = 0.1, 0.03, 0.5
"""Time between two updates of the progress line [s]. The first is for a terminal, the second for a
terminal and a trial with a target, and the third for other outputs such as a notebook."""
PLAIN_WIDTH = 100
"""Width of the progress line if standard error is not a terminal [characters]."""
SHOWN = 4
"""Largest number of estimators whose estimates the line shows."""
HEADING, SHORT_HEADING = f"  {STIFFNESS.heading}, {DAMPING.heading}, * misfit:", "  k, b:"
"""Headings of the estimates, on a wide and on a narrow terminal."""
K_WIDTH, B_WIDTH = 5, 5
"""Widths of an estimate of k [N/m] and of b [N s/m] with its sign [characters]. Wider values are
rare."""
LONGEST_MODE = "stopping"
"""Longest name of a mode in which the line shows estimates."""
NO_CONTACT = "  no contact"
STDERR = 2
"""File descriptor of standard error."""


class Status(NamedTuple):
    """Data that the progress line shows in addition to the time."""

    mode: str
    """Mode of the safety supervisor."""
    target: float
    """Position of the target that the operator follows [m]; NaN without a target."""
    position: float
    """Position of the slave [m]."""
    estimates: Sequence[tuple[str, float, float, float]] | None
    """Name, b [N s/m], k [N/m] and misfit of each estimator; None if there is no contact."""


class Progress:
    """The progress line, which shows the state of a running trial on standard error.

    Parameters
    ----------
    shown
        Whether to show the line. Messages of `report` are always written.
    duration
        Duration of the trial [s].
    hint
        Short text in the line that names the key that stops the trial; empty for no text.
    instructions
        Text that explains how to stop the trial. It is written once before the line. Empty if a
        person has already read it.
    largest_misfit
        Limit of the misfit, which is the systematic part of the force error of an estimator. An
        estimator with a larger misfit is marked in the line.
    cue
        Bar that shows the target in the condition `mimic`; None for another condition.
    """

    def __init__(
        self,
        shown: bool,
        duration: float,
        hint: str,
        instructions: str,
        largest_misfit: float,
        cue: Cue | None = None,
    ) -> None:
        self._shown = shown
        self._duration = duration
        self._hint = f"[{hint}]  " if hint else ""
        self._cue = cue
        self._largest_misfit = largest_misfit
        self._due = 0.0
        self._drawn = 0
        self._terminal = Terminal(STDERR)
        for text in (instructions, LEGEND if cue else ""):
            if shown and text:
                width = terminal_width() or PLAIN_WIDTH
                self.report(textwrap.fill(f"teleop: {text}", width, break_on_hyphens=False))

    def show(self, t: float, status: Callable[[], Status]) -> None:
        """Update the progress line, unless the time since the last update is too short.

        Parameters
        ----------
        t
            Time of the trial [s]. The time is negative until the checks before the trial have
            ended. The drives are not armed before.
        status
            Function that returns the data to show. It is called only if the line is updated.
        """
        now = time.monotonic()
        if not self._shown or now < self._due:
            return
        period = REDRAW_CUE if self._cue else REDRAW
        self._due = now + (period if terminal_width() else REDRAW_PLAIN)
        mode, target, position, estimates = status()
        line = f"{self._hint}{mode}  {max(t, 0.0):4.1f} of {self._duration:g} s"
        cue = f"  {self._cue.text(t, target, position)}" if self._cue else ""
        if estimates is None:
            room = (terminal_width() or PLAIN_WIDTH) - len(line + cue) - 1
            self._draw(line + cue + (NO_CONTACT if room >= len(NO_CONTACT) else ""))
            return
        longest = f"{self._hint}{LONGEST_MODE}  {self._duration:4.1f} of {self._duration:g} s"
        self._draw(line + cue + self._texts(estimates, max(len(longest), len(line)) + len(cue)))

    def _texts(self, estimates: Sequence[tuple[str, float, float, float]], used: int) -> str:
        """Return the part of the progress line with the estimates: a heading and their texts.

        Only as many estimators are shown as fit into the line. The text of an estimator has the
        same width at each update, so that the same estimators are always shown. The result is empty
        if the line has no space for an estimator, or if no estimator has an estimate yet.

        Parameters
        ----------
        estimates
            Name, b [N s/m], k [N/m] and misfit of each estimator.
        used
            Largest number of characters that the line needs before the heading.
        """
        room = (terminal_width() or PLAIN_WIDTH) - 1 - used
        texts = [self._text(*one) for one in estimates[:SHOWN]]
        heading = HEADING if len("".join([HEADING, *texts])) <= room else SHORT_HEADING
        while texts and len("".join([heading, *texts])) > room:
            texts.pop()
        if not texts or all(math.isnan(k) for _, _, k, _ in estimates[: len(texts)]):
            return ""
        return "".join([heading, *texts])

    def _text(self, name: str, b: float, k: float, misfit: float) -> str:
        """Return the text of an estimator: name, k, b, and a mark if the misfit is too large.

        If there is no estimate yet, dashes replace the values.
        """
        signed = f"{DAMPING.shown(b):+.{max(DAMPING.decimals - 1, 0)}f}"
        values = ("-", "-") if math.isnan(k) else (STIFFNESS.number(k), signed)
        mark = "*" if misfit > self._largest_misfit else " "
        return f"  {name} {values[0]:>{K_WIDTH}} {values[1]:>{B_WIDTH}}{mark}"

    def report(self, text: str) -> None:
        """Write a message on its own line, above the progress line. The message remains visible."""
        self._terminal.write((self._replacing("") + "\r" if self._shown else "") + text + "\n")

    def close(self) -> None:
        """Remove the progress line from the terminal.

        If a person has stopped the output of the terminal (Ctrl-S), the line may remain.
        """
        if self._shown:
            self._terminal.draw(self._replacing("") + "\r")
        self._terminal.close()

    def _draw(self, line: str) -> None:
        """Draw the progress line. The text `line` is cut to the width of the terminal."""
        width = terminal_width() or PLAIN_WIDTH
        self._terminal.draw(self._replacing(line[: width - 1]))

    def _replacing(self, text: str) -> str:
        """Return a text with added control characters, so that it replaces the progress line."""
        drawn, self._drawn = self._drawn, len(text)
        return f"\r{text}\x1b[K" if terminal_width() else f"\r{text:<{drawn}}"


def terminal_width() -> int | None:
    """Return the number of columns of the terminal; None if standard error is not a terminal."""
    try:
        return os.get_terminal_size(STDERR).columns or 80
    except OSError:
        return None
