"""JSON documents without infinite numbers and NaN, which are written as null."""

from __future__ import annotations

import json
from typing import Any

from pydantic_core import from_json, to_jsonable_python


def finite(value: Any) -> Any:
    """Return a value with None instead of each number that is infinite or NaN."""
    return to_jsonable_python(value, inf_nan_mode="null")


def dumps(value: Any, indent: int | None = None) -> str:
    """Return a value as a JSON document of ASCII characters."""
    return json.dumps(finite(value), indent=indent, allow_nan=False)


def loads(document: str | bytes) -> dict[str, Any]:
    """Return the object in a JSON document.

    Raises
    ------
    ValueError
        The text is not a JSON document with one object, or is nested too deeply for pydantic.
    """
    value = from_json(document, allow_inf_nan=False)
    if not isinstance(value, dict):
        raise ValueError("expected a JSON object")
    return value
