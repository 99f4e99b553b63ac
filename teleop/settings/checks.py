"""Check the settings of a trial, and report all problems at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, get_args

from sim_backend import CUBES
from teleop.control.conditions import CONDITIONS
from teleop.errors import InputError
from teleop.names import ClockName
from teleop.printable import is_unicode
from teleop.settings import ranges

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings

RIG_FIELDS = frozenset(("condition", "cube", "depth", "rig", "signal", "tare"))
"""Names of the settings that `problems_of_rig` needs to check the limits of the rig."""


class SettingsError(InputError):
    """Error for invalid settings of a trial. The message has one line for each problem.

    Parameters
    ----------
    own
        Texts of the problems that do not depend on the rig.
    of_rig
        Texts of the problems that depend on the rig and its limits. These problems can be found
        only if all settings in `RIG_FIELDS` are valid.

    Attributes
    ----------
    own, of_rig
        The parameters, as tuples.
    """

    def __init__(self, own: Sequence[str], of_rig: Sequence[str] = ()) -> None:
        super().__init__("\n".join(dict.fromkeys([*own, *of_rig])))
        self.own, self.of_rig = tuple(own), tuple(of_rig)

    def known(self, invalid: set[str]) -> SettingsError:
        """Return an error without the problems that may be caused by default values.

        An invalid setting is replaced by its default value to check the other settings. The
        problems `of_rig` are omitted if a setting in `RIG_FIELDS` was replaced, because the
        default value may have caused them.

        Parameters
        ----------
        invalid
            Names of the settings that were replaced.
        """
        return self if RIG_FIELDS.isdisjoint(invalid) else SettingsError(self.own)


def check_settings(settings: TrialSettings) -> None:
    """Check all settings of a trial.

    If a setting is out of its range, it is replaced by its default value to check the other
    settings. The error contains the problems of all settings.

    Raises
    ------
    SettingsError
        A setting is invalid.
    """
    wrong = [*values_out_of_range(settings)]
    own = [text for _, text in wrong]
    of_rig: Sequence[str] = ()
    kind = type(settings)
    invalid = {name for names, _ in wrong for name in names}
    if any(getattr(settings, name) != getattr(kind, name) for name in invalid):
        names = {field.name for field in fields(settings)} - invalid
        try:
            kind(**{name: getattr(settings, name) for name in names})
        except SettingsError as error:
            others = error.known(invalid)
            own, of_rig = [*own, *others.own], others.of_rig
    elif not wrong:
        own, of_rig = [*inconsistent_values(settings)], [*problems_of_rig(settings)]
    if own or of_rig:
        raise SettingsError(own, of_rig)


def values_out_of_range(settings: TrialSettings) -> Iterator[tuple[tuple[str, ...], str]]:
    """Find the settings whose values are out of their range.

    Yields
    ------
    For each problem, a tuple with the names of the settings that cause the problem, and a message.
    """
    for name, value, allowed in (
        ("condition", settings.condition, tuple(CONDITIONS)),
        ("cube", settings.cube, tuple(CUBES)),
        ("clock", settings.clock, get_args(ClockName)),
    ):
        if value not in allowed:
            yield (name,), f"{name} {value!r}: expected one of {', '.join(allowed)}"
    if not ranges.RATES[0] <= settings.loop_rate <= ranges.RATES[1]:
        yield (
            ("rate",),
            f"rate {settings.loop_rate:g} Hz: expected {ranges.RATES[0]:g} to "
            f"{ranges.RATES[1]:g} Hz",
        )
    elif settings.excitation.highest > 0.05 * settings.loop_rate:
        yield (
            ("rate", "signal"),
            f"frequency {settings.excitation.highest:g} Hz in the excitation: expected at most "
            f"a twentieth of the rate, {0.05 * settings.loop_rate:g} Hz",
        )
    if settings.depth is not None and not 0.0 < settings.depth <= ranges.DEEPEST:
        most = ranges.DEEPEST * 1e3
        yield (
            ("depth",),
            f"depth {settings.depth * 1e3:g} mm: expected more than 0 and at most {most:g} mm",
        )
    for name, text in (("specimen", settings.specimen), ("operator", settings.operator)):
        if len(text) > ranges.NAME or not (text.isprintable() and text == text.strip()):
            yield (name,), f"{name} {text!r}: expected one line of at most {ranges.NAME} characters"
    if len(settings.notes) > ranges.NOTES:
        yield (
            ("notes",),
            f"notes: expected at most {ranges.NOTES} characters, got {len(settings.notes)}",
        )
    if "\0" in settings.notes or not is_unicode(settings.notes):
        yield ("notes",), "notes: expected Unicode text without the character zero"
    if settings.custom_condition and settings.custom_condition.name in CONDITIONS:
        yield (
            ("custom_condition",),
            f"class {settings.custom_condition.name} of the condition: expected another name than "
            f"{', '.join(CONDITIONS)}",
        )
    if settings.count_in is not None and not 0.0 <= settings.count_in <= 60.0:
        yield ("count_in",), f"count_in {settings.count_in:g} s: expected 0 to 60 s"
    try:
        settings.make_conditioner()
    except ValueError as error:
        yield ("conditioning", "bandwidth", "force_lag"), str(error)
    longest = ranges.longest_duration(settings.loop_rate)
    if not 0.0 < settings.duration <= longest:
        yield (
            ("duration",),
            f"duration {settings.duration:g} s: expected more than 0 and at most {longest:.0f} s",
        )


def inconsistent_values(settings: TrialSettings) -> Iterator[str]:
    """Yield a message for each set of settings that do not fit together.

    For example, the signal must be a sine in the condition `mimic`. `problems_of_rig` finds the
    problems that depend on the rig.
    """
    condition, motion = settings.named_condition, settings.intended_motion
    if settings.excitation.kind not in condition.signal_kinds:
        kinds = " or ".join(condition.signal_kinds)
        yield (
            f"signal {settings.excitation.kind}: not in {settings.condition}: expected a {kinds}"
        )
    yield from settings.feedback.problems(settings.condition, None)
    if settings.operator_model.aim_force and not condition.is_free(motion):
        free = [name for name, one in CONDITIONS.items() if one.is_free(motion)]
        yield (
            f"operator_model.aim_force: not in {settings.condition}: expected condition "
            f"{' or '.join(free)}"
        )
    try:
        settings.estimation_preset.bank()
    except ValueError as error:
        yield from str(error).splitlines()
    if settings.duration < 1.0 / settings.loop_rate:
        yield (
            f"duration {settings.duration:g} s: expected at least one tick, "
            f"{1.0 / settings.loop_rate:g} s"
        )


def problems_of_rig(settings: TrialSettings) -> Iterator[str]:
    """Yield a message for each problem that depends on the rig and its limits."""
    condition = settings.named_condition
    target = condition.target_for(settings.intended_motion)
    accepted = settings.excitation.kind in condition.signal_kinds
    if target and accepted and settings.rig and settings.duration < target.shortest:
        yield (
            f"duration {settings.duration:g} s: expected count-in and two periods of the target, "
            f"{target.shortest:g} s or more"
        )
    yield from settings.feedback.problems(settings.condition, settings.rig)
    if settings.rig and settings.clock != "real":
        yield "clock virtual: a hardware rig runs in real time: expected real"
    try:
        settings.tare.check(settings.rig_name)
    except InputError as error:
        yield str(error)
    looser = [*settings.tightened_limits.looser(settings.untightened_limits)]
    for name, value, present in looser:
        yield (
            f"tightened_limits.{name}: {value} is looser than {present}, the limit of the "
            f"rig {settings.rig_name!r}: expected a limit that is at least as tight"
        )
    if looser:
        return
    try:
        limits = settings.raw_limits
    except ValueError as error:
        yield f"tightened_limits: {error}"
        return
    deepest = limits.soft_position[1]
    if settings.depth is not None and settings.depth > deepest:
        yield (
            f"depth {settings.depth * 1e3:g} mm: expected at most {deepest * 1e3:g} mm, the soft "
            f"limit of the slave's position on the rig {settings.rig_name!r}"
        )
    try:
        limits.shifted(settings.tare.zeros)
    except ValueError as error:
        yield f"tare: {error}"
