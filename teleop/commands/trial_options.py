"""The options of a trial, and the objects that they name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from teleop.commands.options import CONTROL, TRIAL
from teleop.commands.quantities import Hertz, Length, Seconds
from teleop.names import (
    ClockName,
    CouplingName,
    CubeName,
    FeedbackName,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from teleop.control.coupling import Coupling
    from teleop.control.excitation_signals import AnySignal
    from teleop.settings.trial_settings import TrialSettings

POSITION_GAIN = 10.0
"""Position gain of the coupling with `--coupling position` [1/s]."""


@dataclass(frozen=True)
class TrialOptions:
    """Options that replace settings of a trial; None keeps the setting."""

    config: Path | None = None
    """Configuration file (TOML), as written by `teleop config init`, or a recording, whose trial is
    run again. The other options override the settings of this file. The defaults below apply
    without such a file."""
    condition: str | None = None
    """Control condition: the operator palpates freely (free); the operator moves the slave along a
    sine (mimic); an excitation signal moves the slave, and nobody holds the handle (autonomous); or
    the name of a condition of another package, see `teleop list conditions`. Default: free."""
    protocol: str | None = None
    """Protocol in place of a condition, with phases such as ramps, holds and sines, by position or
    by force: stress-relaxation, dynamic-sweep, creep, or a file (TOML). The duration is that of the
    protocol."""
    rig: Path | None = None
    """Rig file (TOML) that lists the devices of the rig, or the name of a rig class of an installed
    package. Default: the simulated rig."""
    cube: CubeName | None = None
    """Cube on the simulated rig. Not with a rig file. Default: soft."""
    specimen: str | None = None
    """Name of the specimen. Needed with a rig file. Default: the cube of the simulated rig."""
    operator: str | None = None
    """Name of the operator, for the recording. With the name pointer and --live, the mouse or a
    finger in the live page moves the handle of the simulated rig."""
    notes: str | None = None
    """Notes, for the recording."""
    about: Annotated[tuple[str, ...], Parameter(metavar="NAME=VALUE")] = ()
    """Statement about the data, for the recording, such as licence=CC-BY-4.0: title, authors
    (separated by semicolons), institution, material, preparation, calibration, licence, or
    reference. The section [about] of a configuration file has the same names."""
    duration: Seconds | None = None
    """Duration of the trial [s]. Default: 10."""
    until: str | None = None
    """End the trial when the 95 % intervals of the result are narrow enough, such as k=2%,b=10%, or
    after the duration. Default: the trial has the full duration."""
    clock: ClockName | None = None
    """real: the trial runs in real time. virtual: the trial runs as fast as possible, with exactly
    the same result for the same seed. Default: real."""
    depth: Length | None = None
    """Depth of the palpation, such as 5mm. Needed with a rig file. Default: the
    paper's depth for the cube."""
    seed: int | None = None
    """Seed of the simulated operator and of the sensor noise. Default: 0."""
    tare: Path | None = None
    """File with the zero offsets of the channels, from `teleop rig tare`."""
    rate: Annotated[Hertz | None, Parameter(group=CONTROL)] = None
    """Sampling rate of the control loop [Hz]. Default: the rate in the rig file, or 1000."""
    signal: Annotated[str | None, Parameter(group=CONTROL)] = None
    """Excitation signal of the autonomous condition: sine, multisine, chirp, ramp-hold, or the name
    of a signal of another package, see `teleop list signals`. designed: frequency, amplitude and
    mean depth are chosen during the trial, so that k and b become precise soon. Default: sine."""
    frequency: Annotated[Hertz | None, Parameter(group=CONTROL)] = None
    """Frequency of the excitation signal, or of the sine that the operator follows in mimic [Hz].
    For a multisine, it is the lowest of five harmonics; for a chirp over two octaves, the lowest
    frequency; for ramp-hold, that of the repetition, of which a half is the hold; for designed, the
    highest that may be chosen. Default: 1 in mimic, 4 for designed, 2 otherwise."""
    link: Annotated[str | None, Parameter(group=CONTROL)] = None
    """Name of a link of another package, which computes the velocities of master and slave in place
    of admittance and coupling, see `teleop list links`. Default: none."""
    coupling: Annotated[CouplingName | None, Parameter(group=CONTROL)] = None
    """velocity: the slave follows the velocity of the master, as in the paper. position: the slave
    also follows the position of the master. Default: velocity."""
    set: Annotated[tuple[str, ...], Parameter(group=CONTROL, metavar="NAME=VALUE")] = ()
    """Parameter of the chosen condition, signal, link or rig, such as amplitude=2mm or, if several
    have it, condition.amplitude=2mm. `teleop list` shows the parameters."""
    feedback: Annotated[FeedbackName | None, Parameter(group=CONTROL)] = None
    """Force feedback to the hand: none; the contact force (position-force); or a local model of
    the specimen at the master (model-mediated). Default: none."""
    channel: Annotated[str | None, Parameter(group=CONTROL)] = None
    """Communication channel between master and slave, such as delay=100ms,jitter=20ms,loss=5%. The
    delay is one-way, so the round trip is twice the delay. Default: none."""

    force_master: Annotated[str | None, Parameter(group=CONTROL)] = None
    """Force-commanded master of the simulated rig, as most haptic devices are: the word default, or
    values in SI units such as stiffness=500,latency=2,max_force=12. Default: a velocity-commanded
    master with a force sensor."""
    force_slave: Annotated[str | None, Parameter(group=CONTROL)] = None
    """Force-commanded slave of the simulated rig: the word default, or values in SI units such as
    latency=2,max_force=300. Default: a velocity-commanded slave."""

    def settings(self, others: Mapping[str, Any]) -> TrialSettings:
        """The settings of the trial, changed by these options and by `others`, all at once.

        Settings are checked together when they are created, so that a valid combination of changes
        must not pass through an invalid one.
        """
        from sim_backend.force_master import ForceMaster, parse_values
        from sim_backend.slave_drives import ForceSlave
        from teleop.commands.part_options import chosen_parts, with_parameters
        from teleop.control.channel import parse_channel
        from teleop.control.conditions import CONDITIONS
        from teleop.control.excitation_signals import Designed
        from teleop.control.tare import read_tare
        from teleop.control.wanted_precision import parse_wanted
        from teleop.errors import InputError, as_input_error
        from teleop.settings.configuration import read_configuration
        from teleop.settings.plug_ins import PARTS, is_rig_file
        from teleop.settings.protocol_files import load_protocol
        from teleop.settings.provenance import with_statements
        from teleop.settings.rig_loading import load_rig_file
        from teleop.settings.trial_settings import TrialSettings

        settings = read_configuration(self.config) if self.config else TrialSettings()
        given = {name: value for name, value in vars(self).items() if value is not None}
        if self.protocol:
            if self.condition:
                raise InputError("--protocol and --condition: expected at most one of them")
            given["protocol"] = protocol = load_protocol(self.protocol)
            given.setdefault("duration", protocol.longest)
            given["custom_condition"] = None
        elif self.condition:
            given["protocol"] = None
        named = {part: str(given.pop(part)) for part in PARTS if part in given}
        if self.rig:
            given.setdefault("rate", None)  # a recorded rate is that of the recorded rig
            given["rig"] = load_rig_file(self.rig) if is_rig_file(self.rig) else None
            if given["rig"]:
                del named["rig"]
                given["custom_rig"] = None
        given |= chosen_parts(settings, named)
        if given.get("custom_signal", settings.custom_signal):
            if self.frequency is not None:
                raise InputError(
                    "--frequency: not with a signal of another package: expected --set"
                )
        elif self.signal or self.frequency is not None:
            condition = given.get("condition", settings.condition)
            usual = CONDITIONS[condition].default_frequency
            kind = self.signal or settings.excitation.kind
            if kind == "designed":
                usual = Designed.highest
            frequency = usual if self.frequency is None else self.frequency
            given["signal"] = make_signal(kind, frequency)
        with as_input_error():
            if self.until:
                given["until"] = parse_wanted(self.until)
        if self.coupling:
            given["coupling"] = make_coupling(self.coupling)
        if self.feedback:
            given["feedback"] = replace(settings.feedback, law=self.feedback)
        if self.channel:
            with as_input_error():
                given["channel"] = parse_channel(self.channel)
        with as_input_error():
            if self.force_master:
                given["force_master"] = parse_values("force master", ForceMaster, self.force_master)
            if self.force_slave:
                given["force_slave"] = parse_values("force slave", ForceSlave, self.force_slave)
        given["about"] = with_statements(settings.about, self.about)
        if self.tare:
            given["tare"] = read_tare(self.tare)
        for name in ("config", "frequency", "link", "set"):  # no settings
            given.pop(name, None)
        chosen = {
            part: one
            for part in PARTS
            if (one := given.get(f"custom_{part}", getattr(settings, f"custom_{part}")))
            and (one.plug_in or not one.module)
        }
        given |= with_parameters(chosen, self.set)
        settings = replace(settings, **given, **others)
        if self.cube and not settings.is_simulated:
            raise InputError(
                "--cube: belongs to the simulated rig: expected --specimen and --depth"
            )
        return settings


Trial = Annotated[TrialOptions, Parameter(name="*", group=TRIAL)]
DEFAULTS = TrialOptions()


def make_signal(name: str, frequency: float) -> AnySignal:
    """The signal of a kind and lowest frequency [Hz]; InputError for a wrong frequency."""
    from teleop.control.excitation_signals import Chirp, Designed, Multisine, RampHold, Sine
    from teleop.errors import InputError

    try:
        match name:
            case "sine":
                return Sine(frequency)
            case "multisine":
                return Multisine(tuple(frequency * harmonic for harmonic in range(1, 6)))
            case "chirp":
                return Chirp(frequency, 4.0 * frequency)
            case "designed":
                return Designed(frequency)
            case _:  # ramp-hold
                period = 1.0 / Sine(frequency).frequency
                return RampHold(0.05 * period, 0.5 * period, 0.4 * period)
    except ValueError as error:
        raise InputError(f"frequency {frequency:g} Hz: {error}") from error


def make_coupling(name: CouplingName) -> Coupling:
    """The coupling that follows the velocity of the master, or also its position."""
    from teleop.control.coupling import Coupling

    return Coupling(position_gain=POSITION_GAIN) if name == "position" else Coupling()
