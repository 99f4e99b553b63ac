"""Read and write JSON documents. Infinite numbers and NaN are written as null."""

from __future__ import annotations

import json
from typing import Any


def finite(value: Any) -> Any:
    """The value in JSON types, with None for infinite numbers and NaN."""
    from pydantic_core import to_jsonable_python  # a command that writes no JSON starts sooner

    return to_jsonable_python(value, inf_nan_mode="null")


def dumps(value: Any, indent: int | None = None) -> str:
    """The value as a JSON document in ASCII characters; in one line without `indent` (spaces)."""
    return json.dumps(finite(value), indent=indent, allow_nan=False)


def loads(document: str | bytes) -> dict[str, Any]:
    """Read a JSON document that contains one object; ValueError for any other text."""
    value = loads_any(document)
    if not isinstance(value, dict):
        raise ValueError("expected a JSON object")
    return value


def loads_any(document: str | bytes) -> Any:
    """Read a JSON document; ValueError if it is not valid, or is nested too deeply."""
    from pydantic_core import from_json

    return from_json(document, allow_inf_nan=False)
