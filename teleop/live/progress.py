"""The progress line, which shows time, mode and estimates on a terminal or in a notebook."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from estimation.misfit import LARGEST_MISFIT
from estimation.quantities import DAMPING, STIFFNESS
from teleop.live.terminal import Terminal
from teleop.printable import wrapped

WIDTH = 30
"""Number of characters of the bar between its ends."""
TARGET, OWN, BOTH = "O", "x", "@"
"""Marks of the target, of the position of the slave, and of both at the same place."""
LEGEND = f"follow {TARGET} with {OWN}; {BOTH} where both are at the same place"
REDRAW, REDRAW_CUE, REDRAW_PLAIN = 0.1, 0.03, 0.5
"""Time between two updates of the progress line [s]. The first is for a terminal, the second for a
terminal and a trial with a target, and the third for other outputs such as a notebook."""
PLAIN_WIDTH = 100
"""Width of the progress line if standard error is not a terminal [characters]."""
VALUE_WIDTH = 9
"""Width of a value with the half width of its interval [characters]. Wider values are rare."""
LARGEST_HALF = 999.0
"""Largest half width of an interval whose digits fit into the line, in the shown unit."""
LONGEST_MISFIT = 9.99
"""Largest misfit whose digits fit into the line."""
KEPT = 1.0
"""Shortest time for which the same estimator is shown as the best one [s]."""
LONGEST_MODE = "stopping"
"""Longest name of a mode in which the line shows estimates."""
NO_CONTACT = "  no contact"
STDERR = 2
"""File descriptor of standard error."""


@dataclass(frozen=True)
class Cue:
    """Bar of characters that shows target and slave position in the condition `mimic`."""

    depth: float
    """Largest displacement of the target [m]."""
    count_in: float
    """Time at the start of the trial during which the target does not move [s]."""

    def text(self, t: float, target: float, position: float) -> str:
        """Return the bar at time t [s], with the rest of the count-in; positions [m] may be NaN."""
        cells = [" "] * WIDTH
        own, aim = self._place(position), self._place(target)
        if own is not None:
            cells[own] = OWN
        if aim is not None:
            cells[aim] = BOTH if aim == own else TARGET
        left = math.ceil(self.count_in - max(t, 0.0))
        return f"|{''.join(cells)}|" + (f" in {left}" if left > 0 else "")

    def _place(self, x: float) -> int | None:
        """Return the place of x [m] in the bar (-0.1 to 1.1 times `depth`); None for NaN."""
        if math.isnan(x):
            return None
        share = (x / self.depth + 0.1) / 1.2
        return min(max(round(share * (WIDTH - 1)), 0), WIDTH - 1)


class Shown(NamedTuple):
    """Values of an estimator that the progress line shows."""

    name: str
    k: float
    """Stiffness [N/m], and the half width of its 95 % interval."""
    k_half: float
    b: float
    """Damping [N s/m], and the half width of its 95 % interval."""
    b_half: float
    misfit: float


class Status(NamedTuple):
    """Data that the progress line shows in addition to the time."""

    mode: str
    """Mode of the safety supervisor."""
    target: float
    """Position of the target that the operator follows [m]; NaN without a target."""
    position: float
    """Position of the slave [m]."""
    estimates: Sequence[Shown] | None
    """Present values of each estimator; None if there is no contact."""


class Progress:
    """The progress line, which shows the state of a running trial on standard error.

    If `shown` is False, only the messages of `report` are written. `hint` names the key that stops
    the trial, and `instructions` explain it once. The misfit of an estimator is shown if it exceeds
    `LARGEST_MISFIT`.
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
        self.note = ""
        """Latest note, such as the precision of the result so far."""
        self._due = 0.0
        self._drawn = 0
        self._chosen, self._chosen_at = 0, -math.inf
        self._terminal = Terminal(STDERR)
        for text in (instructions, LEGEND if cue else ""):
            if shown and text:
                self.report(f"teleop: {text}")

    def show(self, t: float, status: Callable[[], Status]) -> None:
        """Update the line at time t [s] of the trial, unless the last update is too recent.

        `status` is called only if the line is updated.
        """
        now = time.monotonic()
        if not self._shown or now < self._due:
            return
        period = REDRAW_CUE if self._cue else REDRAW
        self._due = now + (period if terminal_width() else REDRAW_PLAIN)
        mode, target, position, estimates = status()
        line = f"{self._hint}{mode}  {max(t, 0.0):4.1f} of {self._duration:g} s"
        cue = f"  {self._cue.text(t, target, position)}" if self._cue else ""
        cue += f"  {self.note}" if self.note else ""
        if estimates is None:
            room = (terminal_width() or PLAIN_WIDTH) - len(line + cue) - 1
            self._draw(line + cue + (NO_CONTACT if room >= len(NO_CONTACT) else ""))
            return
        longest = f"{self._hint}{LONGEST_MODE}  {self._duration:4.1f} of {self._duration:g} s"
        used = max(len(longest), len(line)) + len(cue)
        room = (terminal_width() or PLAIN_WIDTH) - 1 - used
        self._draw(line + cue + self._texts(t, estimates, room))

    def _texts(self, t: float, estimates: Sequence[Shown], room: int) -> str:
        """Return the texts of all estimators; if they do not fit, as much as fits of the best one.

        The text of an estimator has the same width at each update.
        """
        if all(math.isnan(one.k) for one in estimates):
            return ""
        every = "".join(self._text(one) for one in estimates)
        if len(every) <= room:
            return every
        best = self._best(t, estimates)
        width = max(len(one.name) for one in estimates)
        text = self._text(best._replace(name=best.name.ljust(width)))
        return next((part for part in self._shortened(text) if len(part) <= room), "")

    def _best(self, t: float, estimates: Sequence[Shown]) -> Shown:
        """Return the estimator with a small misfit and the narrowest interval of k."""
        if not 0.0 <= t - self._chosen_at < KEPT:
            self._chosen_at = t
            order = [(one.misfit > LARGEST_MISFIT, relative(one)) for one in estimates]
            self._chosen = order.index(min(order))
        return estimates[self._chosen]

    def _text(self, one: Shown) -> str:
        """Return name, k and b with units and intervals, and the misfit if it is large."""
        k = with_half(STIFFNESS.number(one.k), STIFFNESS.shown(one.k_half))
        signed = f"{DAMPING.shown(one.b):+.0f}" if math.isfinite(one.b) else "-"
        b = with_half(signed, DAMPING.shown(one.b_half))
        is_large = one.misfit > LARGEST_MISFIT
        misfit = f"  misfit {min(one.misfit, LONGEST_MISFIT):4.0%}" if is_large else ""
        return f"  {one.name} k {k} {STIFFNESS.unit} b {b} {DAMPING.unit}{misfit:13}"

    @staticmethod
    def _shortened(text: str) -> list[str]:
        """Return a text of `_text`, and the same text without misfit, and without b."""
        before, unit, _ = text.partition(DAMPING.unit)
        return [text, before + unit, text.partition(STIFFNESS.unit)[0] + STIFFNESS.unit]

    def report(self, text: str) -> None:
        """Write a message above the progress line. The message remains.

        On a terminal, it is broken at spaces.
        """
        if width := terminal_width():
            text = wrapped(text, width)
        self._terminal.write((self._replacing("") + "\r" if self._shown else "") + text + "\n")

    def close(self) -> None:
        """Remove the line. It may remain if a person has stopped the terminal (Ctrl-S)."""
        if self._shown:
            self._terminal.draw(self._replacing("") + "\r")
        self._terminal.close()

    def _draw(self, line: str) -> None:
        """Draw the line, cut to the width of the terminal."""
        width = terminal_width() or PLAIN_WIDTH
        self._terminal.draw(self._replacing(line[: width - 1]))

    def _replacing(self, text: str) -> str:
        """Return a text with control characters, so that it replaces the progress line."""
        drawn, self._drawn = self._drawn, len(text)
        return f"\r{text}\x1b[K" if terminal_width() else f"\r{text:<{drawn}}"


def with_half(value: str, half: float) -> str:
    """Return a value and the half width of its interval, right-aligned in `VALUE_WIDTH`."""
    if math.isnan(half) or value == "-":
        return f"{value:>{VALUE_WIDTH}}"
    limited = f"{half:.0f}" if half <= LARGEST_HALF else f">{LARGEST_HALF:.0f}"
    return f"{value}\u00b1{limited}".rjust(VALUE_WIDTH)


def relative(one: Shown) -> float:
    """Return the half width of the interval of k as a fraction of k; infinite if not known."""
    width = one.k_half / abs(one.k) if one.k else math.inf
    return math.inf if math.isnan(width) else width


def terminal_width() -> int | None:
    """Return the number of columns of the terminal; None if standard error is not a terminal."""
    try:
        return os.get_terminal_size(STDERR).columns or 80
    except OSError:
        return None
