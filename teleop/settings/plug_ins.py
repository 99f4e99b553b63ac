"""Find the conditions, signals, links and rigs that other installed packages provide.

A package provides such a part of an experiment by an entry point, which is a line in its metadata
that names a class. The class is a dataclass. Its fields are the parameters, which a configuration
file, the command line or a recording states.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from difflib import get_close_matches
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_type_hints

from pydantic import TypeAdapter, ValidationError

from drivers import Rig
from drivers.problems import value_problem
from drivers.registry import NAME, RIGS, checked_class, offered, package
from teleop.control.conditions import CONDITIONS, Condition
from teleop.control.excitation_signals import SIGNALS, Signal
from teleop.control.link import Link
from teleop.errors import InputError
from teleop.settings.documented_schema import attribute_docstrings

PartName = Literal["condition", "signal", "link", "rig"]
Plain = bool | int | float | str | None
"""Value of a parameter. A recording contains it exactly."""


class Part(NamedTuple):
    """A part of an experiment that another package can provide."""

    group: str
    """Group of the entry points."""
    base: type
    """Base class of the part."""
    built_in: Mapping[str, type]
    """Classes of this package by name."""


PARTS: dict[PartName, Part] = {
    "condition": Part("teleop.conditions", Condition, CONDITIONS),
    "signal": Part("teleop.signals", Signal, SIGNALS),
    "link": Part("teleop.links", Link, {}),
    "rig": Part(RIGS, Rig, {}),
}
"""The parts of an experiment, by the name of the setting."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a class of another package."""

    name: str
    type: Any
    """Type of the values, for pydantic."""
    default: Any
    """Default value; `MISSING` if the parameter is required."""
    unit: str
    """SI unit; empty if the type states none, see `teleop.settings.values`."""
    description: str


def entry_point(part: PartName, name: str) -> EntryPoint | None:
    """Return the entry point of a part with a name; None if no installed package has it."""
    found = tuple(offered(PARTS[part].group, tuple(sys.path)).select(name=name))
    return found[0] if found else None


def names_of(part: PartName) -> list[str]:
    """Return the names of this package and of other packages, in this order."""
    built_in = PARTS[part].built_in
    others = offered(PARTS[part].group, tuple(sys.path)).names - built_in.keys()
    return [*built_in, *sorted(others)]


def is_plug_in(part: PartName, name: str) -> bool:
    """Return whether the name of a part is not one of this package."""
    return name not in PARTS[part].built_in


def is_rig_file(rig: Path) -> bool:
    """Return whether a path is that of a rig file, and not the name of a rig of another package.

    A path that exists is that of a rig file, and so is a path with a folder, or with an ending
    unless an installed package has a rig of this name.
    """
    named = rig.name == str(rig) and not rig.exists()
    return not named or bool(rig.suffix and entry_point("rig", rig.name) is None)


def plug_in_class(part: PartName, name: str) -> Any:
    """Return the class that another package provides under a name.

    Raises
    ------
    InputError
        No installed package provides this name, or the class cannot be used. The message has one
        line.
    """
    about = PARTS[part]
    if not NAME.fullmatch(name) or entry_point(part, name) is None:
        known = names_of(part)
        similar = get_close_matches(name, known, 1)
        hint = f"did you mean {similar[0]}? " if similar else ""
        expected = f"one of {', '.join(known)}" if known else "an installed package that has it"
        if part == "rig":
            expected = f"a rig file{', or one of ' if known else ''}{', '.join(known)}"
        raise InputError(f"{part} {name!r}: {hint}expected {expected}")
    try:
        found = checked_class(about.group, name, dict.fromkeys(about.built_in, ""), about.base)
    except ValueError as error:
        raise InputError(str(error)) from error
    if part != "rig" and not is_dataclass(found):
        raise InputError(f"{named(part, name)}: expected a dataclass, whose fields are parameters")
    return found


def named(part: PartName, name: str) -> str:
    """Return the name of a part with that of its package, for messages."""
    point = entry_point(part, name)
    return f"{part} {name!r} of the package {package(point)}" if point else f"{part} {name!r}"


def parameters_of(kind: Any) -> dict[str, Parameter]:
    """Return the parameters of a class by name.

    They are the fields of a dataclass. Of a rig, they are the arguments of the constructor after
    the first one, which is the function that returns the time.
    """
    if is_dataclass(kind):
        hints = get_type_hints(kind, include_extras=True)
        texts = {
            name: text
            for cls in reversed(kind.__mro__)  # type: ignore[union-attr]
            for name, text in attribute_docstrings(cls).items()
        }
        found = {
            one.name: (
                hints[one.name],
                one.default_factory() if callable(one.default_factory) else one.default,
            )
            for one in fields(kind)
            if one.init
        }
    else:
        hints, texts = get_type_hints(kind.__init__, include_extras=True), {}
        found = {
            name: (hints.get(name, Any), MISSING if one.default is one.empty else one.default)
            for name, one in [*inspect.signature(kind).parameters.items()][1:]
            if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)
        }
    return {
        name: Parameter(name, hint, default, unit_of(hint), " ".join(texts.get(name, "").split()))
        for name, (hint, default) in found.items()
    }


def unit_of(hint: Any) -> str:
    """Return the SI unit that an annotated type states; empty if it states none."""
    for extra in getattr(hint, "__metadata__", ()):
        schema = getattr(extra, "json_schema_extra", None)
        if isinstance(schema, Mapping):
            return str(schema.get("unit", ""))
    return ""


def checked_parameters(
    part: PartName, name: str, kind: Any, given: Mapping[str, Any]
) -> dict[str, Plain]:
    """Return all parameters of a class, checked, with the defaults of those that are not given.

    Raises
    ------
    InputError
        A parameter is unknown, missing or invalid. The message has one line for each problem.
    """
    known = parameters_of(kind)
    what, expected = f"{part} {name!r}", ", ".join(known) or "no parameter"
    problems = [
        f"{what}: unknown parameter {one!r}: expected {expected}"
        for one in given
        if one not in known
    ]
    values: dict[str, Plain] = {}
    for one in known.values():
        if one.name not in given:
            if one.default is MISSING:
                problems.append(f"{what}: {one.name}: is missing: expected {form_of(one)}")
                continue
            values[one.name] = one.default
            continue
        try:
            values[one.name] = TypeAdapter(one.type).validate_python(given[one.name])
        except ValidationError as error:
            part_of = error.errors(include_url=False)[0]
            problems.append(f"{what}: {one.name}: {value_problem(part_of)}")
    if problems:
        raise InputError("\n".join(problems))
    return values


def form_of(one: Parameter) -> str:
    """Return which value is expected for a parameter."""
    return f"a value in {one.unit}" if one.unit else "a value"
