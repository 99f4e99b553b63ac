"""Find the keys and the types of values that are permitted at a place in a configuration file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from teleop.trial.settings import TrialSettings

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
MOST_LISTED = 12
"""Largest number of keys that a message lists. If there are more, only a similar key is stated."""
Place = Sequence[str | int]
"""Place of a value in the document: the keys of all tables around it, and its own key."""


def forms(place: Place) -> list[Any]:
    """Return the permitted types of the value at a place; empty for an unknown place."""
    found: list[Any] = [TrialSettings]
    for key in place:
        found = [after for form in found for after in below(form, key)]
    return found


def below(form: Any, key: str | int) -> Iterator[Any]:
    """Yield the permitted types of the value with the key `key` in a table of type `form`.

    In the places that pydantic reports, the kind of a signal or the class name of a body is an
    additional key. If `key` is the kind or the class name of `form`, `form` itself is yielded. If
    `form` is the type of a list, nothing is yielded.
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
    """Yield the types in a type hint, which may be a union. None is omitted."""
    if get_origin(hint) in (Union, UnionType):
        for one in get_args(hint):
            yield from flat(one)
    elif hint not in (None, type(None)):
        yield hint


def keys(form: Any) -> list[str]:
    """Return the keys of the table that describes an object of a dataclass."""
    names = (field.name for field in fields(form))
    return [NAMES.get(name, name) if form is TrialSettings else name for name in names]


def unknown_key(place: Place) -> str:
    """Return a message for an unknown key, with the known keys or a similar known key."""
    key = str(place[-1])
    known = [name for form in forms(place[:-1]) if is_dataclass(form) for name in keys(form)]
    if len(place) == 1 and key in NAMES:
        return f"unknown setting: expected {NAMES[key]}"
    if 0 < len(known) <= MOST_LISTED:
        return f"unknown setting: expected one of {', '.join(dict.fromkeys(known))}"
    similar = get_close_matches(key, known, 1)
    return f"unknown setting: expected {similar[0]}" if similar else "unknown setting"


def expected_form(place: Place, value: Any) -> str:
    """Return a text that describes the table or list that is expected at a place.

    The text is empty if the place is unknown.

    Parameters
    ----------
    place
        Place of the value: the keys of all tables around it, and its own key.
    value
        The given value. If it is the name of a kind of signal, the table of this kind is described.
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
