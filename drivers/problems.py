"""Describe the problems of a TOML file as text: syntax errors, and errors that pydantic finds."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
"""Pattern of the text with line and column at the end of an error message of `tomllib`."""
LONGEST_INPUT = 60
"""Largest number of characters of an invalid value that a message contains."""
EXPECTED = {
    "bool": "true or false",
    "dataclass": "a table",
    "dict": "a table",
    "float": "a number",
    "int": "a whole number",
    "list": "a list",
    "mapping": "a table",
    "model": "a table",
    "string": "text in quotes",
    "tuple": "a list",
}
"""Expected form of a value, by the first word of the error type that pydantic gives."""


def syntax_problem(error: Exception, text: str) -> str:
    """Return a text that describes a syntax error of a TOML file, with the line of the error."""
    message = str(error)
    place = PLACE.search(message)
    if place is None:
        return f"not a TOML file: {message}"
    what = message[: place.start()]
    if place[1] is None:
        return f"not a TOML file: {as_phrase(what)} at the end of the file"
    line = text.splitlines()[int(place[1]) - 1].strip()
    return f"not a TOML file: line {place[1]}, column {place[2]}, {as_phrase(what)}: {line}"


def value_problem(part: Mapping[str, Any]) -> str:
    """Return a text that describes a problem which pydantic found in a value.

    The text contains the invalid value, if there is one. It does not contain the key of the value.
    """
    kind, context = part["type"], part.get("ctx", {})
    if kind == "missing":
        return "is missing"
    if kind in ("unexpected_keyword_argument", "extra_forbidden"):
        return "unknown setting"
    if kind == "value_error":
        return as_phrase(part["msg"]) + given(part["input"])
    if kind == "literal_error":
        expected = str(context["expected"]).replace("'", "").replace(" or ", ", ")
        return f"expected one of {expected}{given(part['input'])}"
    if kind == "union_tag_invalid":
        tags = str(context["expected_tags"]).replace("'", "")
        return f"{tag_name(part)} {context['tag']!r}: expected one of {tags}"
    if kind == "union_tag_not_found":
        return f"expected a table with the key {tag_name(part)}"
    form = EXPECTED.get(kind.partition("_")[0])
    if form is None or not kind.endswith(("_type", "_parsing", "_from_float")):
        return as_phrase(part["msg"]).replace("input should be ", "expected a value ") + given(
            part["input"]
        )
    return f"expected {form}{given(part['input'])}"


def tag_name(part: Mapping[str, Any]) -> str:
    """Return the name of the key whose value determines which keys a TOML table can have.

    For example, the key `kind` distinguishes serial ports, CAN buses and networks.
    """
    return str(part["ctx"]["discriminator"]).strip("'")


def given(value: Any) -> str:
    """Return the end of an error message that shows the invalid value, for example `, got 5`.

    If the invalid value is a TOML table, an empty text is returned.
    """
    if isinstance(value, dict):
        return ""
    text = repr(value)
    shown = text if len(text) <= LONGEST_INPUT else f"{text[:LONGEST_INPUT]} ..."
    return f", got {shown}"


def as_phrase(message: str) -> str:
    """Return an error message of pydantic or tomllib in a form that can follow a colon.

    The prefix `Value error, ` is removed, and the first letter is changed to lower case.
    """
    message = message.removeprefix("Value error, ")
    return message[:1].lower() + message[1:]
