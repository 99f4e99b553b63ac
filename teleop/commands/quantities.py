"""Types of options for quantities: a number with a unit, or a number in SI units."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from cyclopts import Token

EXAMPLES = {
    "time": "5ms",
    "frequency": "20Hz",
    "position": "5mm",
    "angle": "30deg",
    "stiffness": "5000N/m",
    "compliance": "7um/N",
    "force": "2N",
}
NOUNS = {"position": "length"}
LARGEST_PLAIN = {"position": 0.5, "angle": 1.6, "compliance": 1e-3}
"""Largest number without a unit, in SI units. A larger number is refused, because it is probably in
mm, degrees or um/N."""


def in_si(kind: str) -> Callable[[Any, Sequence[Token]], float]:
    """A converter of cyclopts for one kind of quantity; a number without a unit is in SI units."""

    def convert(_: Any, tokens: Sequence[Token]) -> float:
        """The value of the option in SI units."""
        return in_si_or_plain(str(tokens[0].keyword), tokens[0].value, kind)

    return convert


def in_si_or_plain(option: str, text: str, kind: str) -> float:
    """The value in SI units of a text with a unit, or of a number without one; else InputError."""
    from teleop.errors import InputError
    from teleop.evaluation.formats.units import OPTION_UNITS, quantity

    value = quantity(text, kind)
    largest = LARGEST_PLAIN.get(kind, math.inf)
    if value is None:
        with contextlib.suppress(ValueError):
            plain = float(text)
            value = plain if math.isfinite(plain) and abs(plain) <= largest else None
    if value is None:
        si = next(unit for unit, size in OPTION_UNITS[kind].items() if size == 1.0)
        limit = f" up to {largest:g}" if largest < math.inf else ""
        raise InputError(
            f"{option} {text!r}: expected a {NOUNS.get(kind, kind)} with its unit, "
            f"such as {EXAMPLES[kind]}, or a number in {si}{limit}"
        )
    return value


def kind_of_unit(unit: str) -> str | None:
    """The kind of quantity of an SI unit; None if options accept no other unit for it."""
    from teleop.evaluation.formats.units import OPTION_UNITS

    return next((kind for kind, units in OPTION_UNITS.items() if units.get(unit) == 1.0), None)


Seconds = Annotated[float, Parameter(converter=in_si("time"), metavar="TIME")]
Hertz = Annotated[float, Parameter(converter=in_si("frequency"), metavar="FREQUENCY")]
Length = Annotated[float, Parameter(converter=in_si("position"), metavar="LENGTH")]
Stiffness = Annotated[float, Parameter(converter=in_si("stiffness"), metavar="STIFFNESS")]
Compliance = Annotated[float, Parameter(converter=in_si("compliance"), metavar="COMPLIANCE")]
Angle = Annotated[float, Parameter(converter=in_si("angle"), metavar="ANGLE")]
