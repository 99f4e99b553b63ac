"""Check whether the settings of a trial fit together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from teleop.control.conditions import BY_HAND, CONDITIONS, Condition
from teleop.control.protocol import LAG, ProtocolSettings
from teleop.errors import InputError
from teleop.safety import Limits
from teleop.settings import ranges

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings

RIG_FIELDS = frozenset(("condition", "cube", "depth", "rig", "signal", "tare"))
"""Names of the settings that `problems_of_rig` needs to check the limits of the rig."""


class SettingsError(InputError):
    """Error for invalid settings of a trial. The message has one line for each problem.

    `of_rig` are the problems that depend on the rig and its limits. They can be found only if all
    settings in `RIG_FIELDS` are valid. `own` are the other ones.
    """

    def __init__(self, own: Sequence[str], of_rig: Sequence[str] = ()) -> None:
        super().__init__("\n".join(dict.fromkeys([*own, *of_rig])))
        self.own, self.of_rig = tuple(own), tuple(of_rig)

    def known(self, invalid: set[str]) -> SettingsError:
        """Return an error without the problems that default values of `invalid` may have caused."""
        return self if RIG_FIELDS.isdisjoint(invalid) else SettingsError(self.own)


def check_settings(settings: TrialSettings) -> None:
    """Check whether the settings fit together. The range of each setting is part of its type."""
    own = [*inconsistent_values(settings)]
    fastest = 0.05 * settings.loop_rate
    of_rig: list[str] = []
    if settings.highest_frequency > fastest:
        own.append(
            f"frequency {settings.highest_frequency:g} Hz in the excitation: expected at most "
            f"a twentieth of the rate, {fastest:g} Hz"
        )
    else:  # the limits depend on the frequency
        of_rig = [*problems_of_rig(settings)]
    if own or of_rig:
        raise SettingsError(own, of_rig)


def inconsistent_values(settings: TrialSettings) -> Iterator[str]:
    """Yield a message for each set of settings that do not fit together, on any rig."""
    if settings.custom_condition and settings.custom_condition.name in CONDITIONS:
        yield (
            f"class {settings.custom_condition.name} of the condition: expected another name than "
            f"{', '.join(CONDITIONS)}"
        )
    condition, motion = settings.performed_as, settings.intended_motion
    if not accepts(condition, settings):
        kinds, named = " or ".join(condition.signal_kinds), settings.signal_name
        yield f"signal {named}: not in {settings.condition_name}: expected a {kinds}"
    yield from settings.feedback.problems(settings.condition_name, settings.by_hand, None)
    yield from problems_of_link(settings)
    if settings.operator_model.aim_force and not condition.is_free(motion):
        free = [name for name, one in CONDITIONS.items() if one().is_free(motion)]
        yield (
            f"operator_model.aim_force: not in {settings.condition_name}: expected condition "
            f"{' or '.join(free)}"
        )
    try:
        settings.make_conditioner()
        settings.estimation_preset.bank()
    except ValueError as error:
        yield from str(error).splitlines()
    if settings.protocol:
        yield from problems_of_protocol(settings, settings.protocol)
    shortest, longest = 1.0 / settings.loop_rate, ranges.MOST_TICKS / settings.loop_rate
    if settings.duration < shortest:
        yield f"duration {settings.duration:g} s: expected at least one tick, {shortest:g} s"
    if settings.duration > longest:
        yield (
            f"duration {settings.duration:g} s: expected more than 0 and at most {longest:.0f} s"
        )


def problems_of_side(settings: TrialSettings) -> Iterator[str]:
    """Yield a message if the rig has another side of the telemanipulator than is needed."""
    rig, station = settings.rig and settings.rig.sections, settings.station
    if station and station.side == "both":  # the rig file of a merged recording is that of a slave
        return
    if rig and not station and not rig.has_slave:
        yield (
            f"rig {rig.name!r}: has no drives.slave: expected it, or `teleop station master` for a "
            "slave on another computer"
        )
    elif (
        rig
        and station
        and (rig.has_master, rig.has_slave)
        != (
            settings.has_master,
            settings.has_slave,
        )
    ):
        yield (
            f"rig {rig.name!r}: expected a rig file with the drives and channels of the "
            f"{station.side} only"
        )
    if station and settings.channel:
        yield "channel: simulated within one computer, not between two stations"
    if station and settings.custom_rig:
        yield "custom_rig: not at a station: expected a rig file, or the simulated rig"
    if station and (settings.custom_link or settings.protocol):
        yield "station: not with a link of another package, and not with a protocol"
    if station and settings.until and not settings.has_slave:
        yield "until: the master has no estimates: expected it at the slave station"


def problems_of_rig(settings: TrialSettings) -> Iterator[str]:
    """Yield a message for each problem that depends on the rig and its limits."""
    if problems := [*problems_of_side(settings)]:
        yield from problems
        return
    condition = settings.performed_as
    target = condition.target_for(settings.intended_motion)
    accepted = accepts(condition, settings)
    if target and accepted and settings.rig and settings.duration < target.shortest:
        yield (
            f"duration {settings.duration:g} s: expected count-in and two periods of the target, "
            f"{target.shortest:g} s or more"
        )
    yield from settings.feedback.problems(settings.condition_name, settings.by_hand, settings.rig)
    yield from problems_of_handle(settings)
    yield from problems_of_slave(settings)
    if settings.rig and settings.clock != "real":
        yield "clock virtual: a hardware rig runs in real time: expected real"
    custom = settings.custom_rig
    if custom and custom.plug_in and settings.rig:
        yield f"custom_rig {custom.name}: beside a rig file: expected one of them"
    real = custom and custom.plug_in and not custom.properties.get("virtual_time")
    if custom and real and settings.clock != "real":
        yield f"clock virtual: the rig {custom.name} runs in real time: expected real"
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
    if settings.protocol:
        yield from problems_of_phases(settings, settings.protocol, limits)
    coupling, gain = settings.master_coupling, settings.feedback.gain
    felt = gain * limits.soft_force if settings.feedback.law != "none" else 0.0
    if coupling and felt > coupling.max_force:
        yield (
            f"feedback.gain {gain:g}: with the soft force limit of {limits.soft_force:.3g} N, the "
            f"hand would have to feel {felt:.3g} N, and the motor of the master exerts at most "
            f"{coupling.max_force:g} N: expected a gain of at most "
            f"{coupling.max_force / limits.soft_force:.2g}"
        )
    loop = settings.slave_coupling
    if loop and limits.soft_force > loop.max_force:
        where = "drives.slave.max_force_n" if settings.rig else "force_slave.max_force"
        yield (
            f"{where} {loop.max_force:g} N: expected at least the soft force limit of "
            f"{limits.soft_force:.3g} N, so that the slave can withstand the contact force"
        )
    try:
        limits.shifted(settings.tare.zeros)
    except ValueError as error:
        yield f"tare: {error}"


def accepts(condition: Condition, settings: TrialSettings) -> bool:
    """Return whether a condition accepts the excitation signal of the settings."""
    kinds = set(condition.signal_kinds)
    if settings.custom_signal:
        return kinds >= set(Condition.signal_kinds)
    return settings.excitation.kind in kinds


def problems_of_protocol(settings: TrialSettings, protocol: ProtocolSettings) -> Iterator[str]:
    """Yield a message for each reason why a protocol cannot be performed with other settings."""
    if settings.custom_condition:
        yield "protocol: beside custom_condition: expected one of them"
    if settings.custom_link:
        yield f"link {settings.custom_link.name}: not in a protocol"
    if settings.until:
        yield "until: not in a protocol, whose steps would be left out: expected one of them"
    if settings.signal or settings.custom_signal:
        yield "signal: not in a protocol: expected phases such as cyclic, sweep or random"
    if settings.duration < protocol.longest:
        yield (
            f"duration {settings.duration:g} s: expected at least {protocol.longest:.4g} s, which "
            "the protocol can take"
        )


def problems_of_link(settings: TrialSettings) -> Iterator[str]:
    """Yield a message if a link of another package does not fit to other settings."""
    if not settings.custom_link:
        return
    what = f"link {settings.custom_link.name}"
    if settings.has_link:
        yield f"{what}: not with force feedback or a channel: expected one of them"
    if settings.condition not in BY_HAND and not settings.custom_condition:
        yield (
            f"{what}: not in {settings.condition}, whose force moves the admittance of the "
            f"settings: expected {' or '.join(BY_HAND)}"
        )


def problems_of_phases(
    settings: TrialSettings, protocol: ProtocolSettings, limits: Limits
) -> Iterator[str]:
    """Yield a message for each phase that does not respect the limits of the rig."""
    depth, lag = settings.setup.depth, settings.transmission.force_lag + limits.drive_lag
    for number, phase in enumerate(protocol.phases, start=1):
        what = f"protocol, phase {number} ({phase.kind})"
        if phase.deepest > depth * (1.0 + 1e-9):
            yield (
                f"{what}: depth {phase.deepest * 1e3:g} mm: expected at most the depth of the "
                f"trial, {depth * 1e3:.4g} mm"
            )
        if phase.largest_force > limits.soft_force:
            yield (
                f"{what}: force {phase.largest_force:g} N: expected at most the soft force limit, "
                f"{limits.soft_force:.3g} N"
            )
    if lag > LAG and any(step.by == "force" for step in protocol.steps):
        yield (
            f"protocol: contact force and drive have a lag of {lag * 1e3:.3g} ms: expected at most "
            f"{LAG * 1e3:g} ms, with which the force can be controlled"
        )


def problems_of_handle(settings: TrialSettings) -> Iterator[str]:
    """Yield a message if the rig lacks the handle, or the coupling of the handle is not passive."""
    rig, coupling = settings.rig, settings.master_coupling
    merged = settings.station and settings.station.side == "both"
    if (
        rig
        and settings.has_master
        and not merged
        and not (rig.sections.channels.master_force or coupling)
    ):
        if settings.by_hand:
            others = [name for name in CONDITIONS if name not in BY_HAND]
            yield (
                f"condition {settings.condition_name}: the rig {rig.sections.name!r} has no "
                f"handle: expected {' or '.join(others)}"
            )
        return
    if settings.force_master and rig:
        yield "force_master: belongs to the simulated rig: expected [drives.master] in the rig file"
    if coupling and (problem := coupling.problem(1.0 / settings.loop_rate)):
        yield f"stiffness of the coupling of the master: {problem}"


def problems_of_slave(settings: TrialSettings) -> Iterator[str]:
    """Yield a message if the force-commanded slave of the simulated rig is not stable."""
    slave = settings.force_slave
    if slave and settings.rig:
        yield "force_slave: belongs to the simulated rig: expected [drives.slave] in the rig file"
    elif slave:
        mass, period = settings.plant_parameters.slave_mass, 1.0 / settings.loop_rate
        if problem := slave.problem(mass, period):
            yield f"force_slave.{problem}"
