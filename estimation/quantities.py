"""Name, symbol, unit and decimals with which results are shown to a person.

Tables, figures, reports, LaTeX, the progress line and the live page take them from here, so that
another unit of a result is a change of one line. Files for programs (JSON, CSV, recordings) contain
SI units (`Quantity.column`), so that files of different versions can be compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """How a quantity is shown."""

    name: str
    symbol: str
    si: str
    """SI unit of the values in the program and in files."""
    unit: str
    """Unit in which a person sees the values."""
    factor: float
    """Factor from the SI unit to `unit`."""
    decimals: int
    """Number of decimals if no interval states how precise a value is."""
    large: tuple[tuple[float, str], ...] = ()
    """Larger units for the axis of a figure, the largest first, each with its size in `unit`."""

    @property
    def heading(self) -> str:
        """Heading of a column for a person, for example `k [N/m]`."""
        return f"{self.symbol} [{self.unit}]"

    @property
    def column(self) -> str:
        """Heading of a column in SI units, for a program."""
        return f"{self.symbol} [{self.si}]"

    @property
    def hat(self) -> str:
        """Symbol of the estimate, in mathematics of matplotlib."""
        return f"$\\hat {self.symbol}$"

    @property
    def label(self) -> str:
        """Label of an axis, with mathematics of matplotlib."""
        return f"{self.name} ${self.symbol}$ [{self.unit}]"

    def shown(self, value: float) -> float:
        """Convert a value from SI to `unit`."""
        return value * self.factor

    def number(self, value: float) -> str:
        """Return an SI value as text without its unit; a dash if it is not finite."""
        if not math.isfinite(value):
            return "-"
        return f"{round(self.shown(value), self.decimals) + 0.0:.{self.decimals}f}"  # no -0

    def text(self, value: float, form: str = "") -> str:
        """Return an SI value as text with its unit; `form` is a format such as `.3g`."""
        return f"{self.short(value, form) if form else self.number(value)} {self.unit}"

    def short(self, value: float, form: str) -> str:
        """Return an SI value as text without its unit, and without exponent below ten million."""
        text = f"{self.shown(value):{form}}"
        return f"{float(text):.0f}" if "e+" in text and abs(float(text)) < 1e7 else text

    def axis(self, largest: float) -> tuple[float, str]:
        """Return factor and unit of an axis whose values are up to `largest` (both from SI)."""
        for size, unit in self.large:
            if self.shown(largest) >= size:
                return self.factor / size, unit
        return self.factor, self.unit


STIFFNESS = Quantity("stiffness", "k", "N/m", "N/m", 1.0, 0, large=((1e6, "MN/m"), (1e3, "kN/m")))
DAMPING = Quantity("damping", "b", "N s/m", "N s/m", 1.0, 1)
FORCE_ERROR = Quantity("force error", "e_f", "N", "N", 1.0, 2)
POSITION = Quantity("position", "position", "m", "mm", 1e3, 1)
VELOCITY = Quantity("velocity", "velocity", "m/s", "mm/s", 1e3, 0)
LATENESS = Quantity("lateness", "lateness", "s", "ms", 1e3, 1)
FORCE = Quantity("force", "force", "N", "N", 1.0, 1)
RESULTS = {one.symbol: one for one in (STIFFNESS, DAMPING, FORCE_ERROR)}
"""What an estimator or an evaluation finds, by symbol."""
SIGNALS = {one.symbol: one for one in (POSITION, VELOCITY, FORCE)}
"""What sensors measure, by symbol."""


def quantity(symbol: str, si: str) -> Quantity:
    """Return how a parameter is shown: as in `RESULTS`, or in its SI unit `si`."""
    return RESULTS.get(symbol) or Quantity(symbol, symbol, si, si, 1.0, 3)
