"""Check the drives of a rig by small test motions (strokes), and test their watchdogs.

A watchdog stops a drive that receives no commands. During the check, the safety supervisor is
active, with limits tighter than those of the rig.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from drivers import AXES, Measurement, RigError
from drivers.rig_file import RigFile
from drivers.rig_sections import ChannelsSettings
from drivers.wired_rig import WiredRig
from teleop.control.admittance import AdmittanceParameters
from teleop.control.clock import Clock
from teleop.control.conditions import Condition
from teleop.control.tare import Tare
from teleop.errors import InputError
from teleop.recording.recording import reported_fault
from teleop.rig.drive_report import DriveReport, Stroke, drive_report
from teleop.rig.pausable_rig import PausableRig
from teleop.rig.zeroing import ForceZero, force_zero
from teleop.safety import Limits
from teleop.safety.rig_limits import rig_limits
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.streams.stream import STORED, Stream
from teleop.trial.arming import motion_text
from teleop.trial.assembly import make_controller
from teleop.trial.loop import Loop
from teleop.trial.readers import Readers
from teleop.trial.stop_switch import StopSwitch

BAND = 0.25
"""Allowed difference between measured and commanded travel, as a fraction of the commanded
travel."""
SLACK = 50e-6
"""Additional allowed difference, for backlash and for the lag of a small motion [m]."""
COUPLED_SLACK = 0.5e-3
"""The same for a part that is moved by the spring of a coupling, on which it oscillates [m]."""


class DriveTravel:
    """Commanded and measured travel (distance moved) of a drive during a stroke.

    A stroke is a small motion in one direction. It is a part of the check of the drives.

    A drive that is `coupled` accepts forces, and its axis follows the velocity through a spring.
    Friction, or a hand that holds the moving part, stretches the spring. A smaller travel is then
    no error. A motor that pushes in the wrong direction drives it away from the commanded travel.
    """

    def __init__(
        self, name: str, channels: ChannelsSettings, compliance: float, coupled: bool = False
    ) -> None:
        encoder = channels.master_position if name == "master" else channels.slave_position
        self.commanded = 0.0
        """Commanded travel since the beginning of the stroke [m]."""
        self._name = name
        self._coupled = coupled
        self._compliance = compliance if name == "slave" else 0.0
        self._resolution = encoder.resolution_um * 1e-6 if encoder else 0.0
        self._position = self._force = self._start = self._start_force = math.nan
        self._integral = 0.0

    def begin(self) -> None:
        """Begin a stroke (a motion in one direction): set commanded and measured travel to zero."""
        self.commanded = self._integral = 0.0
        self._start, self._start_force = self._position, self._force

    def advance(self, velocity: float, measurement: Measurement, dt: float) -> None:
        """Update the commanded and the measured travel with the data of one tick."""
        self.commanded += velocity * dt
        slave = self._name == "slave"
        self._position = measurement.slave_position if slave else measurement.master_position
        self._integral += (measurement.slave_velocity if slave else math.nan) * dt
        self._force = measurement.contact_force

    @property
    def moved(self) -> float:
        """Travel since the beginning of the stroke, measured by the encoder [m].

        A stroke is a motion in one direction. The value is NaN if the drive has no encoder.
        """
        return self._position - self._start

    @property
    def explained(self) -> float:
        """Difference of commanded and measured travel that two known effects can cause [m].

        The effects are the resolution of the encoder, and the displacement of the drive by a change
        of the contact force (compliance times change of force).
        """
        return self._resolution + self._compliance * abs(self._force - self._start_force)

    def problem(self, settled: bool) -> str:
        """Return a text that describes an error of the measured travel; empty if there is no error.

        The measured travel is compared with the commanded travel. A travel that is too large or in
        the opposite direction is always an error.
        """
        slack = (COUPLED_SLACK if self._coupled else SLACK) + self.explained
        band = BAND * abs(self.commanded) + slack
        shown = {f"{self._name}_position": self.moved}
        if settled:
            shown[f"{self._name}_velocity"] = self._integral
        for channel, moved in shown.items():
            along = math.copysign(1.0, self.commanded) * moved
            behind = abs(self.commanded) - along
            too_small = settled and not self._coupled
            if behind < -band or (behind > band if too_small else along < -slack):
                part = "sign" if along < 0.0 or self._coupled else "scale"
                return (
                    f"commanded {self.commanded * 1e3:+.3f} mm, {channel} shows "
                    f"{moved * 1e3:+.3f} mm: expected a difference of at most {BAND:.0%} and "
                    f"{slack * 1e3:.2f} mm: check the {part} of drives.{self._name} and of "
                    f"channels.{channel}"
                    + (", and that nobody holds the moving part" if self._coupled else "")
                )
        return ""


REACH = 1e-3
"""Largest distance of the slave from its position at the start of the check [m]."""
SOFT_FORCE, HARD_FORCE = 0.025, 0.05
"""Soft and hard limit of the change of the contact force since the start of the check, as fractions
of the hard force limit of the rig."""


def narrow_limits(limits: Limits, zero: ForceZero) -> Limits:
    """Return narrow limits for the check of the drives, which permit only a small motion.

    The position limits are relative to the present position of the slave.
    """
    low, high = (end - zero.position for end in limits.hard_position)
    if not low <= 0.0 <= high:
        raise InputError(
            f"slave_position is {zero.position * 1e3:g} mm: expected it within "
            f"hard_position_mm, {limits.hard_position[0] * 1e3:g} to "
            f"{limits.hard_position[1] * 1e3:g} mm"
        )
    hard = max(low, -REACH), min(high, REACH)
    soft_force, hard_force = narrow_forces(limits)
    return replace(
        limits,
        soft_position=(0.8 * hard[0], 0.8 * hard[1]),
        hard_position=hard,
        soft_force=soft_force,
        hard_force=hard_force,
    )


def narrow_forces(limits: Limits) -> tuple[float, float]:
    """Return the soft and the hard limit of the contact force for the check of the drives [N].

    The contact force is zero at the start of the check. `limits` are the limits of the rig.
    """
    return min(SOFT_FORCE * limits.hard_force, limits.soft_force), HARD_FORCE * limits.hard_force


STROKES = (50e-6, 100e-6, 200e-6, 400e-6)
"""Lengths of the strokes [m]. Each stroke is a motion in one direction and back."""
STROKE_TIMES = (2.0, 0.4, 0.4, 0.4)
"""Duration of each stroke in one direction [s].

The first stroke is slow. If a drive moves 20 times too fast, even a force sensor with 100 samples
per second then measures the contact force early enough to stop the drive.
"""
ENOUGH = 0.9
"""Smallest allowed length of a stroke that the limits have shortened, as a fraction of its planned
length."""
WARM, SETTLING = 0.2, 0.2
"""Duration of the standstill before the first stroke, and after each motion [s]."""
SILENCE = 2.0
"""Time without commands within which a watchdog must stop the drive [s]."""
LONGEST = 60.0
"""Longest duration of the whole check [s]."""
QUICK = AdmittanceParameters(mass=0.015, damping=15.0)
"""Parameters of an admittance with a small time constant (mass / damping), so that the velocity of
the drives quickly reaches the wanted velocity."""


class DrivesReport(NamedTuple):
    """Result of the check of all drives of a rig."""

    drives: list[DriveReport]
    """Result of each drive."""
    fault: dict[str, Any] | None
    """Event of the fault for which the supervisor stopped the check; None if there was no fault."""
    interrupted: bool
    """Whether a person stopped the check."""
    bus_load: dict[str, float]
    """Load of each bus while commands were sent, see `BusLoad.loads`."""


class DriveCheck(Condition):
    """Moves the drives of a rig to check them. It has the interface of a control condition.

    The drives move in strokes of increasing length. A stroke is a motion in one direction and back.
    Then no commands are sent until the watchdogs have stopped the drives.
    """

    def __init__(
        self, rig: PausableRig, drives: Mapping[str, DriveTravel], damping: float, direction: int
    ) -> None:
        self.problems: dict[str, str] = {}
        """Problems, by the name of the drive. The first problem ends the check."""
        self.watchdogs: dict[str, float] = {}
        """Time from the last command until the watchdog stopped each drive [s]."""
        self.strokes: dict[str, list[Stroke]] = {name: [] for name in drives}
        """Travel of each drive in the first half of each stroke, by the name of the drive."""
        self._rig = rig
        self._drives = drives
        self._damping = damping
        self._direction = direction
        self._time = 0.0
        self._steps = self._plan()

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force that moves the drives at the wanted velocity [N].

        The force acts on the virtual mass of the admittance. The method also updates the measured
        travel of the drives.
        """
        dt, self._time = t - self._time, t
        for name, drive in self._drives.items():
            drive.advance(self._rig.applied[AXES.index(name)], measurement, dt)
        velocity = next(self._steps, None)
        self.finished = velocity is None or bool(self.problems)
        return 0.0 if self.finished or velocity is None else self._damping * velocity

    def _plan(self) -> Iterator[float]:
        """Yield the wanted velocity of the drives [m/s] for each tick of the whole check.

        The generator also evaluates the check at each tick, and stores the results in `strokes`,
        `watchdogs` and `problems`.
        """
        yield from self._stand(WARM)
        if self._direction:
            for length, seconds in zip(STROKES, STROKE_TIMES, strict=True):
                yield from self._stroke(self._direction, length, seconds)
                self._store_stroke()
                self._check_length(length)
                back = abs(self._drives["slave"].commanded)
                yield from self._stroke(-self._direction, back, seconds)
        self._rig.paused = True
        begun = self._time
        seen = self._rig.reporting
        while self._time - begun < SILENCE and len(self.watchdogs) < len(seen):
            yield 0.0
            for name in self._rig.stopped():
                self.watchdogs.setdefault(name, self._time - begun)
        for name in seen - self.watchdogs.keys():
            self.problems[name] = f"its watchdog did not act within {SILENCE:g} s without a command"

    def _stand(self, seconds: float) -> Iterator[float]:
        end = self._time + seconds
        while self._time < end:
            yield 0.0

    def _stroke(self, direction: int, length: float, seconds: float) -> Iterator[float]:
        """Yield the wanted velocity [m/s] for each tick of one motion and a standstill after it.

        The motion has the length `length` [m] and takes `seconds` [s]. If the limits reduce the
        velocity, the motion takes up to twice this time, and can be shorter than `length`. The
        travel of the drives is checked at every tick.
        """
        for drive in self._drives.values():
            drive.begin()
        deadline = self._time + 2.0 * seconds
        while self._time < deadline and abs(self._drives["slave"].commanded) < length:
            yield direction * length / seconds
            self._check_travel(settled=False)
        for _ in self._stand(SETTLING):
            yield 0.0
            self._check_travel(settled=False)
        self._check_travel(settled=True)

    def _check_travel(self, settled: bool) -> None:
        for name, drive in self._drives.items():
            if problem := drive.problem(settled):
                self.problems.setdefault(name, problem)

    def _store_stroke(self) -> None:
        for name, drive in self._drives.items():
            self.strokes[name].append(
                Stroke(
                    abs(drive.commanded),
                    math.copysign(1.0, drive.commanded) * drive.moved,
                    drive.explained,
                )
            )

    def _check_length(self, length: float) -> None:
        """Check that each drive moved far enough in the latest stroke, in spite of the limits.

        `length` is the planned length of the stroke [m]. If the commanded travel of a drive is less
        than the fraction `ENOUGH` of it, this is stored as a problem of the drive. A problem ends
        the check of all drives.
        """
        for name, strokes in self.strokes.items():
            if strokes[-1].commanded < ENOUGH * length:
                self.problems.setdefault(
                    name,
                    f"the limits allowed {strokes[-1].commanded * 1e3:.3f} mm of "
                    f"{length * 1e3:g} mm, too little to check sign and scale: expected a slave "
                    "that is free to move",
                )


def arming_text(rig: RigFile) -> str:
    """Return a text that describes how the drives will move during their check.

    A person reads the text before arming (enabling) the drives. `rig` is the content of the rig
    file.
    """
    soft_force, hard_force = narrow_forces(rig_limits(rig.sections))
    return motion_text(
        rig.sections.name,
        f"check, both drives move by {STROKES[0] * 1e3:g} to {STROKES[-1] * 1e3:g} mm and back, "
        f"change of the contact force limited to {soft_force:g} N, stop at {hard_force:g} N",
    )


def check_drives(rig: WiredRig, clock: Clock, move: bool) -> DrivesReport:
    """Check the watchdogs of the drives. If `move` is True, also check sign and scale of motion.

    A watchdog stops a drive that receives no commands. The drives are enabled at standstill, and
    are disabled at the end. To check sign and scale, the drives make small motions back and forth.
    To test the watchdogs, no commands are then sent until the watchdogs have stopped the drives.
    """
    sections = rig.file.sections
    limits, zero = rig_limits(sections), force_zero(rig, clock)
    about = narrow_limits(limits, zero)
    tested = PausableRig(rig)
    drives = {
        name: DriveTravel(name, sections.channels, limits.drive_compliance, name in rig.coupled)
        for name, _ in sections.drives.items()
    }
    away = -1 if about.soft_position[0] <= -STROKES[-1] else 1
    test = DriveCheck(tested, drives, QUICK.damping, away if move else 0)
    settings = TrialSettings(
        condition="autonomous",
        duration=LONGEST,
        rate=clock.rate,
        admittance=QUICK,
        estimators=("rls",),
        rig=rig.file,
        tare=Tare(zero.master, zero.contact, zero.position),
        custom_limits=about,
    )
    layout = Layout(settings.estimation_preset.bank())
    stream = Stream(layout, round(STORED * settings.loop_rate))
    controller = make_controller(settings, tested, clock, test)
    try:
        with StopSwitch(key=True) as switch, switch.reading_keys():
            Loop(controller, clock, stream, Readers(), switch, settings.duration).run()
    except BaseException:
        rig.idle()
        raise
    if controller.error and not isinstance(controller.error, RigError):
        raise controller.error
    reports = [
        drive_report(
            name,
            test.watchdogs.get(name, math.nan),
            test.strokes[name],
            test.problems.get(name, ""),
            name in rig.coupled,
            name in tested.reporting,
        )
        for name in drives
    ]
    fault = reported_fault(stream.events)
    return DrivesReport(reports, fault, switch.interrupted, tested.load.loads())
