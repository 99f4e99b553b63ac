"""JSON as its standard has it: finite numbers, null for the others, and no deep nesting."""

from __future__ import annotations

import json
import math
from typing import Any

DEEPEST = 50
"""Most levels of nesting that are read."""


def finite(value: Any) -> Any:
    """The value with null for every number that is not finite."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def dumps(value: Any, indent: int | None = None) -> str:
    """The value as a JSON document."""
    return json.dumps(finite(value), indent=indent, allow_nan=False)


def loads(document: str | bytes) -> dict[str, Any]:
    """The object in a JSON document.

    Raises
    ------
    ValueError
        It is no JSON document, no object, or nested deeper than `DEEPEST`.
    """
    try:
        value = json.loads(document)
    except RecursionError as error:
        raise ValueError("JSON is nested too deep") from error
    if not isinstance(value, dict):
        raise ValueError("expected a JSON object")
    level: list[Any] = [value]
    for _ in range(DEEPEST):
        level = [item for one in level for item in (one.values() if isinstance(one, dict) else one)]
        level = [item for item in level if isinstance(item, dict | list)]
    if level:
        raise ValueError(f"JSON is nested deeper than {DEEPEST} levels")
    return value
