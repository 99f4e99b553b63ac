"""State in a recording which classes of other packages took part in a trial; create them again."""

from __future__ import annotations

import importlib
import inspect
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from typing import Any

from drivers import Measurement, RigError
from teleop.control.conditions import Condition, IntendedMotion
from teleop.control.excitation_signals import Derivatives, Signal
from teleop.errors import InputError
from teleop.printable import is_unicode
from teleop.settings.plug_ins import (
    PARTS,
    PartName,
    checked_parameters,
    entry_point,
    named,
    plug_in_class,
)


@dataclass(frozen=True)
class CustomClass:
    """Class of another package, with which a part of a trial is created.

    A user states only the name and the parameters of a part that an installed package provides. The
    other fields are then found.
    """

    name: str
    """Name of the part that an installed package provides, or of the class passed to `run_trial`.
    """
    module: str = ""
    """Module that defines the class."""
    distribution: str = ""
    """Installed distribution that contains the module; empty if there is none."""
    version: str = ""
    """Version of the distribution."""
    parameters: Mapping[str, bool | int | float | str | None] = field(default_factory=dict)
    """Fields of the object if its class is a dataclass, otherwise its attributes. Only finite
    numbers, texts, truth values and None are stated."""
    state: Mapping[str, bool | int | float | str | None] = field(default_factory=dict)
    """Further attributes of an object of a dataclass at the start of the trial."""
    complete: bool = False
    """Whether `parameters` are sufficient to create the object again."""
    plug_in: bool = False
    """Whether `name` is that of a part that the distribution provides by an entry point."""
    properties: Mapping[str, bool | int | float | str | None] = field(default_factory=dict)
    """What the evaluation of a recording must know of the part, if it is not installed."""

    def __str__(self) -> str:
        return f"{self.name} of {self.distribution or self.module} {self.version}".rstrip()


def stated_part(part: PartName, stated: CustomClass) -> CustomClass:
    """Return the complete statement about a part of which a user has stated name and parameters.

    A statement that is complete, because a recording contains it, is not changed.

    Raises
    ------
    InputError
        The part is not installed or cannot be used, or a parameter is invalid. The message has one
        line for each problem.
    """
    if stated.module:
        return stated
    kind = plug_in_class(part, stated.name)
    point = entry_point(part, stated.name)
    installed = point.dist if point else None
    values = checked_parameters(part, stated.name, kind, stated.parameters)
    found = CustomClass(
        stated.name,
        kind.__module__,
        installed.name if installed else "",
        installed.version if installed else "",
        values,
        complete=all(map(is_plain, values.values())),
        plug_in=True,
    )
    if part == "rig":
        return replace(found, properties={"virtual_time": bool(kind.virtual_time)})
    made = called(named(part, stated.name), kind, **values)
    if isinstance(made, Signal):
        return replace(found, properties={"highest": made.highest, "text": made.text})
    if isinstance(made, Condition):
        return replace(found, properties={"moved_by": made.moved_by})
    return found


def called(what: str, function: Callable[..., Any], *values: Any, **named: Any) -> Any:
    """Return the result of a function of another package; InputError if it raises an exception."""
    try:
        return function(*values, **named)
    except (KeyboardInterrupt, InputError, RigError):
        raise
    except BaseException as error:  # also SystemExit, which would end the program without a message
        text = " ".join(str(error).split())
        reason = text if type(error) is ValueError else f"{type(error).__name__}: {text}"
        raise InputError(f"{what}: cannot be used: {reason}") from error


def described(custom: object) -> CustomClass:
    """Return the statement about an object of a class of the user."""
    kind = type(custom)
    distribution = distribution_of(kind.__module__)
    names = [*getattr(custom, "__dict__", {})]
    attributes = {name: getattr(custom, name) for name in names}
    if is_dataclass(custom):
        names = [one.name for one in fields(custom) if one.init]
        every = (one.name for one in fields(custom) if hasattr(custom, one.name))
        attributes |= {name: getattr(custom, name) for name in every}
    plain = {name: value for name, value in attributes.items() if is_plain(value)}
    return CustomClass(
        kind.__qualname__,
        kind.__module__,
        distribution,
        version(distribution) if distribution else "",
        {name: plain[name] for name in names if name in plain},
        {name: value for name, value in plain.items() if name not in names},
        # Only the fields of a dataclass are known to be the arguments of its constructor. A
        # constructor of a derived class, or an InitVar, has other ones.
        is_dataclass(custom)
        and plain.keys() >= set(names)
        and [*inspect.signature(kind).parameters] == names,
    )


def distribution_of(module: str) -> str:
    """Return the name of the installed distribution that contains a module; empty if none does."""
    found = installed_packages(tuple(sys.path)).get(module.partition(".")[0], [])
    return found[0] if found else ""


@cache
def installed_packages(path: tuple[str, ...]) -> Mapping[str, list[str]]:
    """Return the distributions of each package in `sys.path`; the search takes 0.1 s or more."""
    return packages_distributions()


def is_plain(value: object) -> bool:
    """Return whether a JSON document contains a value exactly, as a number, a text or null."""
    if isinstance(value, str):
        return type(value) is str and is_unicode(value)
    if type(value) is float:
        return math.isfinite(value)
    return value is None or type(value) is bool or (type(value) is int and abs(value) < 2**63)


def create(part: PartName, stated: CustomClass) -> Any:
    """Create the part of a trial that a user or a recording states.

    Of a rig, the result is a function that creates it, from the function that returns the time [s].

    Raises
    ------
    InputError
        The part is not installed, has another version than the recorded one, or cannot be created
        with the recorded parameters.
    """
    what = f"{part} {stated}"
    if part == "rig" and not stated.plug_in:
        raise InputError(
            f"{what}: a recording cannot create it: expected rig_maker= in Python, or another rig"
        )
    kind = class_of(part, stated, what)
    if not stated.complete:
        raise InputError(
            f"{what}: its parameters are not recorded: expected a dataclass whose fields are "
            "numbers or texts, to run it again"
        )
    if part == "rig":
        return partial(called, what, kind, **stated.parameters)
    if stated.plug_in:
        checked_parameters(part, stated.name, kind, stated.parameters)
    found = called(what, kind, **stated.parameters)
    now = described(found)
    differ = [
        name
        for recorded, present in ((stated.parameters, now.parameters), (stated.state, now.state))
        for name, value in recorded.items()
        if present.get(name) != value
    ]
    if differ:
        raise InputError(
            f"{what}: {', '.join(differ)}: a new object has another value than the recorded one"
        )
    return found


def class_of(part: PartName, stated: CustomClass, what: str) -> Any:
    """Return the class of a part, of the recorded version; InputError if it is not installed."""
    if not stated.distribution:
        raise InputError(f"{what}: expected a class of an installed distribution, to run it again")
    try:
        installed = version(stated.distribution)
    except PackageNotFoundError:
        raise InputError(f"{what}: is not installed") from None
    if installed != stated.version:
        raise InputError(f"{what}: expected this version, but {installed} is installed")
    if stated.plug_in:
        point = entry_point(part, stated.name)
        if not (point and point.dist and point.dist.name == stated.distribution):
            raise InputError(f"{what}: this distribution does not provide it")
        return plug_in_class(part, stated.name)
    # A recording may come from anyone: import only what the stated distribution contains.
    if distribution_of(stated.module) != stated.distribution:
        raise InputError(f"{what}: module {stated.module} is not in this distribution")
    try:
        kind: Any = importlib.import_module(stated.module)
        for name in stated.name.split("."):
            kind = getattr(kind, name)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        text = " ".join(str(error).split())
        raise InputError(f"{what}: cannot be created: {type(error).__name__}: {text}") from error
    # A function or another class could do anything with the recorded parameters.
    base = PARTS[part].base
    if not (isinstance(kind, type) and issubclass(kind, base)):
        raise InputError(f"{what}: expected a class derived from {base.__name__}")
    return kind


def number_of(value: object, usual: float) -> float:
    """Return a recorded number, or a usual one if it is none."""
    is_number = isinstance(value, float | int) and not isinstance(value, bool)
    return float(value) if is_number else usual  # type: ignore[arg-type]


class StatedCondition(Condition):
    """A condition of which only the recorded statement is known, because it is not installed."""

    def __init__(self, stated: CustomClass) -> None:
        self._stated = stated
        if stated.properties.get("moved_by") == "injector":
            self.moved_by = "injector"  # type: ignore[misc]

    def motion_texts(self, motion: IntendedMotion) -> dict[str, str]:
        """Return the recorded parameters."""
        return {name: f"{value}" for name, value in self._stated.parameters.items()}

    def averaged_times(self, motion: IntendedMotion) -> tuple[float, float, str]:
        """Return the recorded part of the trial."""
        known = self._stated.properties
        start, end = (number_of(known.get(name), usual) for name, usual in AVERAGED)
        return start, end, str(known.get("left_out", ""))

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Refuse to move the master."""
        raise InputError(f"condition {self._stated}: is not installed")


AVERAGED = (("averaged_from", -math.inf), ("averaged_to", math.inf))
"""Recorded properties with start and end of the averaged part of a trial, and their defaults."""


def with_averaged(stated: CustomClass, condition: Condition, motion: IntendedMotion) -> CustomClass:
    """Return a statement with the properties that the evaluation of a trial needs."""
    start, end, left_out = condition.averaged_times(motion)
    values = {"averaged_from": start, "averaged_to": end}
    finite = {name: value for name, value in values.items() if math.isfinite(value)}
    properties = {"moved_by": condition.moved_by, **finite, "left_out": left_out}
    return replace(stated, properties={**stated.properties, **properties})


@dataclass(frozen=True)
class StatedSignal(Signal):
    """A signal of which only the recorded statement is known, because it is not installed."""

    stated: CustomClass

    @property
    def highest(self) -> float:
        """Highest frequency that the signal contains [Hz]."""
        return number_of(self.stated.properties.get("highest"), 0.0)

    @property
    def text(self) -> str:
        """Short description."""
        return str(self.stated.properties.get("text", self.stated))

    def at(self, t: float) -> Derivatives:
        """Refuse to compute a value."""
        raise InputError(f"signal {self.stated}: is not installed")


def known_condition(stated: CustomClass) -> Condition:
    """Return the condition of a statement for the evaluation: installed, or as it is recorded."""
    try:
        found = create("condition", stated) if stated.plug_in else None
    except InputError:
        found = None
    return found or StatedCondition(stated)


def known_signal(stated: CustomClass) -> Signal:
    """Return the signal of a statement for the evaluation: installed, or as it is recorded."""
    try:  # a recording may come from anyone: only what a package offers is imported
        found: Signal | None = create("signal", stated) if stated.plug_in else None
    except InputError:
        found = None
    return found or StatedSignal(stated)
