"""State in a recording which class of the user took part in a trial, and create it again."""

from __future__ import annotations

import importlib
import inspect
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from typing import Any

from teleop.control.conditions import Condition
from teleop.errors import InputError
from teleop.printable import is_unicode


@dataclass(frozen=True)
class CustomClass:
    """Class of a control condition or a rig that the user passed to `run_trial`."""

    name: str
    """Name of the class."""
    module: str
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

    def __str__(self) -> str:
        return f"{self.name} of {self.distribution or self.module} {self.version}".rstrip()


def stated_class(kind: type) -> CustomClass:
    """Return the statement about a class of the user before there is an object."""
    distribution = distribution_of(kind.__module__)
    installed = version(distribution) if distribution else ""
    return CustomClass(kind.__qualname__, kind.__module__, distribution, installed)


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


def create_condition(stated: CustomClass) -> Condition:
    """Create the control condition that a recording states."""
    what = f"condition {stated}"
    if not stated.distribution:
        raise InputError(f"{what}: expected a class of an installed distribution, to run it again")
    try:
        installed = version(stated.distribution)
    except PackageNotFoundError:
        raise InputError(f"{what}: is not installed") from None
    if installed != stated.version:
        raise InputError(f"{what}: expected this version, but {installed} is installed")
    if not stated.complete:
        raise InputError(
            f"{what}: its parameters are not recorded: expected a dataclass whose fields are "
            "numbers or texts, to run it again"
        )
    # A recording may come from anyone: import only what the stated distribution contains.
    if distribution_of(stated.module) != stated.distribution:
        raise InputError(f"{what}: module {stated.module} is not in this distribution")
    try:
        kind: Any = importlib.import_module(stated.module)
        for name in stated.name.split("."):
            kind = getattr(kind, name)
        # A function or another class could do anything with the recorded parameters.
        if not (isinstance(kind, type) and issubclass(kind, Condition)):
            raise InputError(f"{what}: expected a class derived from Condition")
        condition: Condition = kind(**stated.parameters)
        created = described(condition)
    except InputError:
        raise
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # also SystemExit, which would end the program without a message
        text = " ".join(str(error).split())
        raise InputError(f"{what}: cannot be created: {type(error).__name__}: {text}") from error
    differ = [
        name
        for recorded, now in (
            (stated.parameters, created.parameters),
            (stated.state, created.state),
        )
        for name, value in recorded.items()
        if now.get(name) != value
    ]
    if differ:
        raise InputError(
            f"{what}: {', '.join(differ)}: a new object has another value than the recorded one"
        )
    return condition
