"""Read and write JSON documents. Infinite numbers and NaN are written as null."""

from __future__ import annotations

import json
from typing import Any

from pydantic_core import from_json, to_jsonable_python


def finite(value: Any) -> Any:
    """Convert a value to JSON types. Replace each infinite number and each NaN by None."""
    return to_jsonable_python(value, inf_nan_mode="null")


def dumps(value: Any, indent: int | None = None) -> str:
    """Return a value as the text of a JSON document, in ASCII characters.

    Parameters
    ----------
    value
        The value. Infinite numbers and NaN are written as null.
    indent
        Number of spaces by which each level is indented; None for a document in one line.
    """
    return json.dumps(finite(value), indent=indent, allow_nan=False)


def loads(document: str | bytes) -> dict[str, Any]:
    """Read a JSON document that contains one object, and return the object as a dictionary.

    Raises
    ------
    ValueError
        The text is not a JSON document with one object, or is nested too deeply.
    """
    value = loads_any(document)
    if not isinstance(value, dict):
        raise ValueError("expected a JSON object")
    return value


def loads_any(document: str | bytes) -> Any:
    """Read a JSON document that contains any value, and return the value.

    Raises
    ------
    ValueError
        The text is not a JSON document, or is nested too deeply.
    """
    return from_json(document, allow_inf_nan=False)
