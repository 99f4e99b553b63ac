"""Define the wanted precision of k and b, at which a trial can end."""

from __future__ import annotations

from dataclasses import dataclass

PARTS = ("k", "b")
REACHED = "reached"
"""First word of the statement that the wanted precision is reached."""
EXAMPLE = "expected half widths of 95 % intervals such as k=2%,b=10%"


@dataclass(frozen=True)
class WantedPrecision:
    """Largest half widths of the 95 % intervals of k and b, as fractions of k and b.

    Raises
    ------
    ValueError
        Neither k nor b is given, or a value is not between 0 and 1.
    """

    k: float | None = None
    """Half width for k; None for any."""
    b: float | None = None
    """Half width for b; None for any."""

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError(EXAMPLE)
        for part, half in self.parts.items():
            if not 0.0 < half < 1.0:
                raise ValueError(f"{part} {half:g}: expected a half width between 0 and 100 %")

    @property
    def parts(self) -> dict[str, float]:
        """The half widths that are wanted, by `k` and `b`."""
        values = {part: getattr(self, part) for part in PARTS}
        return {part: half for part, half in values.items() if half is not None}

    @property
    def text(self) -> str:
        """The text that `parse_wanted` reads."""
        return ",".join(f"{part}={100.0 * half:g}%" for part, half in self.parts.items())


def parse_wanted(text: str) -> WantedPrecision:
    """Return the wanted precision in a text such as `k=2%,b=10%`."""
    values: dict[str, float] = {}
    for piece in text.split(","):
        part, equals, given = (one.strip() for one in piece.partition("="))
        number = given.removesuffix("%")
        try:
            if not equals or part not in PARTS or part in values:
                raise ValueError
            values[part] = float(number) * (1.0 if number == given else 0.01)
        except ValueError:
            raise ValueError(f"until {text!r}: {piece.strip()!r}: {EXAMPLE}") from None
    try:
        return WantedPrecision(**values)
    except ValueError as error:
        raise ValueError(f"until {text!r}: {error}") from None
