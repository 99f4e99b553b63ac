"""State who measured what, so that others can find, understand and reuse the recordings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Annotated

from pydantic import AfterValidator, Field, ValidationError
from pydantic.dataclasses import dataclass

from teleop.errors import InputError, invalid_lines
from teleop.settings import ranges
from teleop.settings.values import one_line

LICENCE = re.compile(r"[A-Za-z0-9.+:-]+( (AND|OR|WITH) [A-Za-z0-9.+:-]+)*")
"""Form of an SPDX licence expression."""
SEPARATOR = ";"
"""Separator of the authors in a text."""

Line = Annotated[str, Field(max_length=ranges.NAME), AfterValidator(one_line)]


def spdx(text: str) -> str:
    """Check that a text has the form of an SPDX licence expression."""
    if text and not LICENCE.fullmatch(text):
        raise ValueError("expected an SPDX licence identifier, such as CC-BY-4.0")
    return text


@dataclass(frozen=True)
class Provenance:
    """Statements about the data of a trial that the program cannot know.

    The other parts of the metadata are recorded with each trial: date, software, machine, rig,
    units, tare and transmission.
    """

    title: Line = ""
    """Title of the data set to which the trial belongs."""
    authors: tuple[Line, ...] = ()
    """Persons who are responsible for the data, such as `Ada Lee (ORCID 0000-0002-1825-0097)`."""
    institution: Line = ""
    """Institution at which the trial was made."""
    material: Line = ""
    """What the specimen consists of, such as `porcine liver`."""
    preparation: Line = ""
    """How the specimen was prepared and kept, such as `ex vivo, 6 h at 4 deg C, tested at 20`."""
    calibration: Line = ""
    """When and with what the sensors were calibrated."""
    licence: Annotated[Line, AfterValidator(spdx)] = ""
    """Licence of the data, an SPDX identifier such as `CC-BY-4.0`."""
    reference: Line = ""
    """DOI or address of the publication or of the plan of the study."""

    def texts(self) -> dict[str, str]:
        """Return the statements that are not empty, by name."""
        named = {one.name: getattr(self, one.name) for one in fields(self)}
        return {
            name: f"{SEPARATOR} ".join(value) if isinstance(value, tuple) else value
            for name, value in named.items()
            if value
        }


def with_statements(before: Provenance, texts: Sequence[str]) -> Provenance:
    """Return a provenance that is changed by texts such as `licence=CC-BY-4.0`.

    Several authors are separated by semicolons.

    Raises
    ------
    InputError
        A text has another form, or an unknown name, or a value is not valid.
    """
    names = [one.name for one in fields(Provenance)]
    given: dict[str, object] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or name not in names:
            raise InputError(f"--about {text}: expected NAME=VALUE with {', '.join(names)}")
        if name in given:
            raise InputError(f"--about {text}: {name} is given twice")
        parts = tuple(part.strip() for part in value.split(SEPARATOR) if part.strip())
        given[name] = parts if name == "authors" else value
        try:
            replace(before, **{name: given[name]})  # type: ignore[arg-type]
        except ValidationError as error:
            problem = invalid_lines(error)[0].partition(": ")[2]
            raise InputError(f"--about {text}: {problem}") from error
    return replace(before, **given)  # type: ignore[arg-type]
