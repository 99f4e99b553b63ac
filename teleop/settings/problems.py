"""Describe invalid settings as text, from the errors of pydantic and the JSON schema."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError
from pydantic_core import ArgsKwargs, ErrorDetails

from drivers.problems import given, value_problem
from estimation.quantities import POSITION
from teleop.settings.checks import SettingsError
from teleop.settings.values import FILE

DERIVED = {
    "preset": ": expected estimator_parameters or custom_preset",
    "encoder_resolution_m": "",
    "loop_rate_hz": ": expected rate_hz",
    "limits": ": expected tightened_limits",
    "setup": ": expected custom_setup",
    "online_transmission": ": expected force_lag_s or lost_motion_m",
}
"""Keys of values that `to_document` computes from the settings. They are not permitted in a
configuration file. The value of a key is the end of the error message in this case."""
MOST_LISTED = 12
"""Largest number of keys that a message lists. If there are more, only a similar key is stated."""
SHOWN = {one.si: one for one in (POSITION,)}
"""How a message shows a quantity that is not shown in its SI unit, by the SI unit."""

RANGE = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")
"""Types of the errors of pydantic for a number that is out of its range."""

Schema = Mapping[str, Any]
"""A JSON schema, or a part of it."""


def all_problems(
    error: ValidationError,
    values: object,
    handler: Callable[[Any], object],
    keys: Mapping[str, str],
    schema: Schema,
) -> SettingsError:
    """Return an error with the invalid values, and with the problems of the other settings.

    The other settings are checked with default values in place of the invalid ones.

    `values` is a document, or the arguments of the constructor. `handler` creates the settings from
    them. `keys` contains the key in a document of each setting, by the name of the setting.
    """
    names = [*keys]
    parts = error.errors(include_url=False)
    for part in parts:
        if part["loc"] and isinstance(part["loc"][0], int):  # an argument without a keyword
            part["loc"] = (names[part["loc"][0]], *part["loc"][1:])
    own = [line for part in parts for line in problem(part, keys, schema)]
    invalid = {part["loc"][0] for part in parts if part["loc"]}
    try:
        if isinstance(values, ArgsKwargs):
            stated = dict(zip(names, values.args, strict=False)) | (values.kwargs or {})
            rest = {name: value for name, value in stated.items() if name not in invalid}
            handler(ArgsKwargs((), rest))
        elif isinstance(values, Mapping):
            handler({key: value for key, value in values.items() if key not in invalid})
    except SettingsError as others:
        fields = {alias: name for name, alias in keys.items()}
        known = others.known({fields.get(str(key), str(key)) for key in invalid})
        return SettingsError([*own, *known.own], known.of_rig)
    return SettingsError(own)


def problem(part: ErrorDetails, keys: Mapping[str, str], root: Schema) -> Iterator[str]:
    """Yield the lines of text for one error of pydantic. They begin with the keys of the value."""
    found, shown = [root], list[str]()
    for key in part["loc"]:
        # The first key is the name of a setting if the error is one of the constructor.
        name = str(key) if shown else keys.get(str(key), str(key))
        if below := [after for one in found for after in alternatives_below(one, name, root)]:
            shown.append(str(key))
            found = below
        elif tagged := [one for one in found if name in tags(one)]:
            found = tagged  # not a key of the document
        else:
            shown.append(str(key))
            found = found if part["type"] == "unexpected_keyword_argument" else []
    place, value, context = ".".join(shown) or "document", part["input"], part.get("ctx", {})
    if part["type"] in RANGE:
        name = next((name for name, key in keys.items() if key == place), place)
        si = found[0].get("unit", "")
        unit, factor = (SHOWN[si].unit, SHOWN[si].factor) if si in SHOWN else (si, 1.0)
        expected = range_of(found[0], unit, factor)
        yield f"{name} {value * factor:g} {unit}".rstrip() + f": expected {expected}"
    elif part["type"] == "unexpected_keyword_argument":
        yield f"{place}: unknown setting{known_keys(shown, found, keys)}"
    elif part["type"] == FILE:
        yield from (f"{place}: {line}" for line in part["msg"].splitlines())
    elif part["type"] == "literal_error" and place == "condition":
        yield f"{place}: {value_problem(part)}; one of another package: [custom_condition] name"
    elif part["type"] == "string_too_long":
        yield f"{place}: expected at most {context['max_length']} characters, got {len(value)}"
    elif part["type"] == "string_unicode":
        yield f"{place}: expected Unicode text{given(value)}"
    elif part["type"].endswith("_type") or part["type"] == "union_tag_not_found":
        form = form_of(found, shown[-1], value) if shown else ""
        yield (
            f"{place}: expected {form}{given(value)}" if form else f"{place}: {value_problem(part)}"
        )
    else:
        yield f"{place}: {value_problem(part)}"


def alternatives_below(table: Schema, key: str, root: Schema) -> Iterator[Schema]:
    """Yield the schemas of the values that a key in a table may have."""
    properties, others = table.get("properties", {}), table.get("additionalProperties")
    if key in properties:
        yield from alternatives(properties[key], root)
    elif isinstance(others, Mapping):
        yield from alternatives(others, root)


def alternatives(schema: Schema, root: Schema) -> Iterator[Schema]:
    """Yield the schemas of the values that a schema permits, without references and null."""
    if name := schema.get("$ref"):
        yield from alternatives(root["$defs"][name.rpartition("/")[2]], root)
    elif several := schema.get("anyOf") or schema.get("oneOf"):
        for one in several:
            yield from alternatives(one, root)
    elif schema.get("type") != "null":
        yield schema


def tags(table: Schema) -> tuple[object, object]:
    """Return what pydantic adds to the place of an error in a table of a union: kind and class."""
    return table.get("properties", {}).get("kind", {}).get("const"), table.get("title")


def range_of(schema: Schema, unit: str, factor: float) -> str:
    """Return the range of a number as text."""
    above, low, high = (
        schema[name] * factor if name in schema else None
        for name in ("exclusiveMinimum", "minimum", "maximum")
    )
    if low is not None and high is not None:
        return f"{low:g} to {high:g} {unit}"
    least = f"more than {above:g}" if low is None else f"at least {low:g}"
    return f"{least} {unit}" if high is None else f"{least} and at most {high:g} {unit}"


def known_keys(place: list[str], tables: list[Schema], keys: Mapping[str, str]) -> str:
    """Return the end of a message about an unknown key: all known keys, or a similar one."""
    key = place[-1]
    known = [name for table in tables for name in table.get("properties", {})]
    if len(place) == 1 and key in DERIVED:
        return DERIVED[key]
    if len(place) == 1 and key in keys:
        return f": expected {keys[key]}"
    if 0 < len(known) <= MOST_LISTED:
        return f": expected one of {', '.join(dict.fromkeys(known))}"
    similar = get_close_matches(key, known, 1)
    return f": expected {similar[0]}" if similar else ""


def form_of(found: list[Schema], key: str, value: object) -> str:
    """Return which table or list is expected in place of a value; empty if neither is."""
    for schema in found:
        if items := schema.get("prefixItems"):
            return f"a list of {len(items)} numbers"
        if items := schema.get("items"):
            return (
                "a list of texts in quotes" if items == {"type": "string"} else "a list of numbers"
            )
    types = [schema.get("type") for schema in found]
    table = "text in quotes, or a table" if "string" in types else "a table"
    tables = [schema for schema in found if "properties" in schema]
    if not tables:
        return table if "object" in types else ""
    kinds = {kind: one for one in tables if (kind := tags(one)[0])}
    if not kinds:
        return f"{table} with keys such as {', '.join([*tables[0]['properties']][:3])}"
    kind = value if isinstance(value, str) and value in kinds else next(iter(kinds))
    others = [f"{name} = ..." for name in kinds[kind]["properties"] if name != "kind"]
    parts = [f'kind = "{kind}"', *others]
    return f"a table, {key} = {{ {', '.join(parts)} }}"
