"""Choose the parts of a trial that other packages provide, and set their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from teleop.settings.custom_class import CustomClass
    from teleop.settings.plug_ins import Parameter, PartName
    from teleop.settings.trial_settings import TrialSettings


def chosen_parts(settings: TrialSettings, names: Mapping[PartName, str]) -> dict[str, Any]:
    """The settings that follow from the names of parts which options state.

    The name of a part of this package removes a part of another package.
    """
    from teleop.settings.custom_class import CustomClass
    from teleop.settings.plug_ins import is_plug_in

    changes: dict[str, Any] = {}
    for part, name in names.items():
        if not is_plug_in(part, name):
            changes |= {part: name, f"custom_{part}": None}
            continue
        recorded: CustomClass | None = getattr(settings, f"custom_{part}")
        same = recorded and recorded.plug_in and recorded.name == name
        changes[f"custom_{part}"] = recorded if same else CustomClass(name)
        if part == "signal":
            changes["signal"] = None
    return changes


def with_parameters(
    chosen: Mapping[PartName, CustomClass], texts: Sequence[str]
) -> dict[str, CustomClass]:
    """The settings with the chosen parts, and with parameters such as amplitude=2mm.

    Raises
    ------
    InputError
        A part is not installed, or a parameter is unknown, ambiguous or invalid. The message has
        one line for each problem.
    """
    from teleop.errors import InputError
    from teleop.settings.custom_class import CustomClass, stated_part
    from teleop.settings.plug_ins import parameters_of, plug_in_class

    known = (
        {part: parameters_of(plug_in_class(part, one.name)) for part, one in chosen.items()}
        if texts
        else {}
    )
    given: dict[PartName, dict[str, Any]] = {part: {} for part in chosen}
    problems = []
    for text in texts:
        try:
            part, parameter, value = assigned(text, known)
        except InputError as error:
            problems.append(str(error))
            continue
        if parameter.name in given[part]:
            problems.append(f"--set {text}: {parameter.name} is given twice")
        given[part][parameter.name] = value
    if problems:
        raise InputError("\n".join(problems))
    found: dict[str, CustomClass] = {}
    for part, one in chosen.items():
        if given[part]:  # with the parameters of the installed version
            one = CustomClass(one.name, parameters={**one.parameters, **given[part]})
        try:
            found[f"custom_{part}"] = stated_part(part, one)
        except InputError as error:
            problems.append(str(error))
    if problems:
        raise InputError("\n".join(problems))
    return found


def assigned(
    text: str, known: Mapping[PartName, Mapping[str, Parameter]]
) -> tuple[PartName, Parameter, Any]:
    """The part, the parameter and the value of a text such as amplitude=2mm."""
    from teleop.commands.quantities import in_si_or_plain, kind_of_unit
    from teleop.errors import InputError

    name, equals, value = text.partition("=")
    part_name, dot, inner = name.strip().rpartition(".")
    if not (equals and inner):
        raise InputError(f"--set {text}: expected NAME=VALUE, such as amplitude=2mm")
    of_part = {part: names for part, names in known.items() if not dot or part == part_name}
    found = [(part, names[inner]) for part, names in of_part.items() if inner in names]
    if not found:
        every = [f"{part}.{one}" for part, names in known.items() for one in names]
        expected = f"one of {', '.join(every)}" if every else "a part of another package first"
        raise InputError(f"--set {text}: unknown parameter: expected {expected}")
    if len(found) > 1:
        expected = " or ".join(f"{part}.{inner}" for part, _ in found)
        raise InputError(f"--set {text}: several parts have it: expected {expected}")
    ((part, parameter),) = found
    kind = kind_of_unit(parameter.unit)
    return part, parameter, in_si_or_plain(f"--set {inner}", value, kind) if kind else value
