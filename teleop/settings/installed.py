"""List the conditions, signals, links, estimators, devices and rigs that are installed."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING
from functools import partial
from importlib.metadata import EntryPoint
from typing import Any, Literal, NamedTuple, get_args

from drivers.registry import BUILT_IN as DEVICES
from drivers.registry import GROUP as OF_DEVICES
from drivers.registry import device_class, offered, package
from estimation.registry import BUILT_IN as ESTIMATORS
from estimation.registry import GROUP as OF_ESTIMATORS
from estimation.registry import METHODS
from estimation.registry import offered as offered_estimators
from teleop.errors import InputError
from teleop.settings.plug_ins import PARTS, PartName, parameters_of, plug_in_class
from telepalpation import NAME, __version__

ListName = Literal["conditions", "signals", "links", "estimators", "devices", "rigs"]
LISTS: tuple[ListName, ...] = get_args(ListName)


class Installed(NamedTuple):
    """Something that can be chosen by its name, of this package or of another one."""

    name: str
    package: str
    """Name and version of the package."""
    description: str
    """First sentence of the documentation; empty if there is none."""
    parameters: tuple[dict[str, Any], ...] = ()
    """Name, default value, SI unit and description of each parameter."""
    problem: str = ""
    """Why it cannot be used; empty if it can."""


def installed(what: ListName) -> list[Installed]:
    """Return what is installed, that of this package first."""
    return [*own(what), *others(what)]


def own(what: ListName) -> Iterator[Installed]:
    """Yield what this package contains."""
    ours = f"{NAME} {__version__}"
    if what == "estimators":
        for name, factory in ESTIMATORS.items():
            yield Installed(name, ours, first_sentence(getattr(factory, "__self__", factory)))
    elif what == "devices":
        for name in DEVICES:
            yield described(name, ours, partial(device_class, name))
    else:
        for name, kind in PARTS[part_of(what)].built_in.items():
            yield Installed(name, ours, first_sentence(kind))


def others(what: ListName) -> Iterator[Installed]:
    """Yield what other packages provide, also what cannot be used."""
    groups = {"estimators": OF_ESTIMATORS, "devices": OF_DEVICES}
    group = groups.get(what) or PARTS[part_of(what)].group
    for point in sorted(offered(group, tuple(sys.path)), key=lambda one: one.name):
        yield described(point.name, package(point), partial(loaded, what, point), what)


def loaded(what: ListName, point: EntryPoint) -> Any:
    """Return the class or function of another package; InputError or ValueError if it fails."""
    if what == "estimators":
        if problem := offered_estimators().problems.get(point.name):
            raise ValueError(problem)
        METHODS[point.name]  # raises a ValueError that names the package
        return point.load()
    if what == "devices":
        return device_class(point.name)
    return plug_in_class(part_of(what), point.name)


def described(
    name: str, origin: str, load: Callable[[], Any], what: ListName = "devices"
) -> Installed:
    """Return what is known about a class, which is loaded with a function.

    Parameters are those of parts of an experiment only.
    """
    try:
        kind = load()
        stated = {} if what in ("devices", "estimators") else parameters_of(kind)
    except (ImportError, InputError, ValueError) as error:
        return Installed(name, origin, "", problem=" ".join(str(error).split()))
    parameters = tuple(
        {
            "name": one.name,
            "default": None if one.default is MISSING else one.default,
            "required": one.default is MISSING,
            "unit": one.unit,
            "description": one.description,
        }
        for one in stated.values()
    )
    return Installed(name, origin, first_sentence(kind), parameters)


def part_of(what: ListName) -> PartName:
    """Return the part of an experiment whose list has a name."""
    parts: Mapping[str, PartName] = {f"{part}s": part for part in PARTS}
    return parts[what]


def first_sentence(kind: Any) -> str:
    """Return the first line of the documentation of a class."""
    text = inspect.getdoc(kind) or ""
    return text.partition("\n")[0]
