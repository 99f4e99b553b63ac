"""Find the keys and the types of values that are permitted at a place in a configuration file.

A place is a sequence of keys that leads to a value, for example ("signal", "frequency").
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from teleop.settings.trial_settings import TrialSettings

NAMES = {
    "duration": "duration_s",
    "rate": "rate_hz",
    "bandwidth": "bandwidth_hz",
    "force_lag": "force_lag_s",
    "depth": "depth_m",
    "count_in": "count_in_s",
    "preset": "custom_preset",
}
"""Keys in the document that differ from the names in `TrialSettings`, by the name in
`TrialSettings`."""
FIELDS = {key: name for name, key in NAMES.items()}
"""Names in `TrialSettings`, by the key in the document."""
MOST_LISTED = 12
"""Largest number of keys that a message lists. If there are more, only a similar key is stated."""
Place = Sequence[str | int]
"""Place of a value in the document: the keys that lead to it, which end with its own key."""


def forms(place: Place) -> list[Any]:
    """Return the types that a value in a configuration file may have.

    Parameters
    ----------
    place
        Keys that lead to the value, for example ("signal", "frequency").

    Returns
    -------
    The permitted types; empty if a key of `place` is unknown.
    """
    found: list[Any] = [TrialSettings]
    for key in place:
        found = [after for form in found for after in below(form, key)]
    return found


def below(form: Any, key: str | int) -> Iterator[Any]:
    """Yield the types that the value of a key in a table of a configuration file may have.

    Parameters
    ----------
    form
        Type of the table: a dataclass, whose fields are the keys, or a mapping. For other types,
        nothing is yielded.
    key
        The key. In its errors, pydantic adds keys that are not in the file: the kind of a signal,
        such as `sine`, and the class name of a body, such as `Cube`. For such an added key, `form`
        is already the type of the value, and is yielded.
    """
    if get_origin(form) is Mapping:
        yield from flat(get_args(form)[1])
    elif is_dataclass(form) and key in (
        getattr(form, "kind", None),
        getattr(form, "__name__", None),
    ):
        yield form
    elif is_dataclass(form):
        name = FIELDS.get(str(key), str(key)) if form is TrialSettings else str(key)
        yield from flat(get_type_hints(form).get(name))


def flat(hint: Any) -> Iterator[Any]:
    """Yield the types in a type hint. For the union `int | str | None`, these are int and str."""
    if get_origin(hint) in (Union, UnionType):
        for one in get_args(hint):
            yield from flat(one)
    elif hint not in (None, type(None)):
        yield hint


def keys(form: Any) -> list[str]:
    """Return the keys that a table of a configuration file may contain.

    `form` is the dataclass whose fields are the values in the table.
    """
    names = (field.name for field in fields(form))
    return [NAMES.get(name, name) if form is TrialSettings else name for name in names]


def unknown_key(place: Place) -> str:
    """Return an error message for an unknown key in a configuration file.

    The message names all known keys or, if there are more than `MOST_LISTED`, a similar known key.

    Parameters
    ----------
    place
        Keys that lead to the unknown key, and the unknown key itself, for example
        ("signal", "speed").
    """
    key = str(place[-1])
    known = [name for form in forms(place[:-1]) if is_dataclass(form) for name in keys(form)]
    if len(place) == 1 and key in NAMES:
        return f"unknown setting: expected {NAMES[key]}"
    if 0 < len(known) <= MOST_LISTED:
        return f"unknown setting: expected one of {', '.join(dict.fromkeys(known))}"
    similar = get_close_matches(key, known, 1)
    return f"unknown setting: expected {similar[0]}" if similar else "unknown setting"


def expected_form(place: Place, value: Any) -> str:
    """Return a text that states which table or list is expected in place of an invalid value.

    The text is empty if neither a table nor a list is expected, or if a key is unknown.

    Parameters
    ----------
    place
        Keys that lead to the value in the configuration file, for example ("signal",).
    value
        The invalid value. If it is the name of a kind of signal, such as `chirp`, the text
        describes the table of this signal.
    """
    found = forms(place)
    if lists := [form for form in found if get_origin(form) is tuple]:
        items = get_args(lists[0])
        what = "texts in quotes" if items[0] is str else "numbers"
        count = "" if Ellipsis in items else f"{len(items)} "
        return f"expected a list of {count}{what}"
    tables = [form for form in found if is_dataclass(form)]
    if not tables:
        return "expected a table" if found and get_origin(found[0]) is Mapping else ""
    kinds = [form for form in tables if hasattr(form, "kind")]
    if not kinds:
        return f"expected a table with keys such as {', '.join(keys(tables[0])[:3])}"
    chosen = next((form for form in kinds if form.kind == value), kinds[0])
    others = [name for name in keys(chosen) if name != "kind"]
    parts = [f'kind = "{chosen.kind}"', *(f"{name} = ..." for name in others)]
    return f"expected a table, {place[-1]} = {{ {', '.join(parts)} }}"
