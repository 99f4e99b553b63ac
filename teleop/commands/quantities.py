"""Types of options for quantities: a number with a unit becomes a value in SI units."""

from __future__ import annotations

import contextlib
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
}
NOUNS = {"position": "length"}


def in_si(kind: str, unit: str = "") -> Callable[[Any, Sequence[Token]], float]:
    """A converter of cyclopts for one kind of quantity.

    `unit` is that of a number without a unit; without it, the text must state the unit.
    """

    def convert(_: Any, tokens: Sequence[Token]) -> float:
        """The value of the option in SI units."""
        from teleop.errors import InputError
        from teleop.evaluation.formats.units import OPTION_UNITS, quantity

        text = tokens[0].value
        value = quantity(text, kind)
        if value is None and unit:
            with contextlib.suppress(ValueError):
                value = float(text) * OPTION_UNITS[kind][unit]
        if value is None:
            plain = f", or a number in {unit}" if unit else ""
            noun = f"{NOUNS.get(kind, kind)} with its unit"
            raise InputError(
                f"{tokens[0].keyword} {text!r}: expected a {noun}, such as {EXAMPLES[kind]}{plain}"
            )
        return value

    return convert


Seconds = Annotated[float, Parameter(converter=in_si("time", "s"), metavar="TIME")]
Hertz = Annotated[float, Parameter(converter=in_si("frequency", "Hz"), metavar="FREQUENCY")]
Length = Annotated[float, Parameter(converter=in_si("position"), metavar="LENGTH")]
Millimetres = Annotated[float, Parameter(converter=in_si("position", "mm"), metavar="LENGTH")]
Stiffness = Annotated[float, Parameter(converter=in_si("stiffness"), metavar="STIFFNESS")]
Compliance = Annotated[float, Parameter(converter=in_si("compliance"), metavar="COMPLIANCE")]
Degrees = Annotated[float, Parameter(converter=in_si("angle", "deg"), metavar="ANGLE")]
