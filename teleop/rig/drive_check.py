"""The check of a rig's drives: small strokes that are judged as they go, and their watchdogs.

It is a trial under the safety supervisor, with tighter limits than those of the rig.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from drivers import AXES, Measurement, RigError
from drivers.wired_rig import WiredRig
from teleop.control.admittance import AdmittanceParameters
from teleop.control.clock import Clock
from teleop.control.conditions import Condition
from teleop.control.tare import Tare
from teleop.errors import InputError
from teleop.recording.black_box import BlackBox
from teleop.recording.message import Layout
from teleop.rig.drive_travel import DriveTravel
from teleop.rig.pausable_rig import PausableRig
from teleop.rig.zeroing import ForceZero, force_zero
from teleop.safety import Limits
from teleop.safety.rig_limits import rig_limits
from teleop.trial.assembly import make_controller
from teleop.trial.loop import Loop
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

STROKES = (50e-6, 100e-6, 200e-6, 400e-6)
"""Lengths of the strokes, each forth and back [m]."""
STROKE_TIMES = (2.0, 0.4, 0.4, 0.4)
"""Time of each stroke, in one direction [s].

The first is so slow that a force sensor of 100 Hz stops a drive that is 20 times too fast in time.
"""
ENOUGH = 0.9
"""Share of a stroke that has to be commanded for it to count."""
WARM, SETTLING = 0.2, 0.2
"""Standstill before the first stroke and after each [s]."""
SILENCE = 2.0
"""Longest wait for a watchdog [s]."""
LONGEST = 60.0
"""Bound of the whole test [s]."""
REACH = 1e-3
"""Farthest that the slave may get from where it stood [m]."""
SOFT_FORCE, HARD_FORCE = 0.025, 0.05
"""Limits of the change of the contact force, as a share of the rig's hard limit."""
QUICK = AdmittanceParameters(mass=0.015, damping=15.0)
"""Follows the wanted velocity with a time constant of 1 ms."""


class DriveReport(NamedTuple):
    """The result of a drive's tests."""

    name: str
    watchdog_s: float
    """From the last command to the drive's own stop; NaN where there was none."""
    commanded_m: float
    """Travel of the longest stroke as commanded; NaN without a motion."""
    moved_m: float
    """The same as the encoder shows it; NaN without a motion or an encoder."""
    problem: str
    """What is wrong; empty for nothing."""


class DrivesReport(NamedTuple):
    """The result of the whole test."""

    drives: list[DriveReport]
    fault: dict[str, Any] | None
    """The event by which the supervisor stopped it, if it did."""
    interrupted: bool
    """Whether a person stopped it."""


class DriveCheck(Condition):
    """Moves forth and back in growing strokes, and lets the watchdogs run out then.

    Parameters
    ----------
    rig
        The rig.
    drives
        What adds up the travel of each drive, by its name.
    damping
        Force on the admittance for a velocity [N s/m].
    direction
        Of the first half of each stroke, 1 or -1; 0 for no motion.
    """

    def __init__(
        self, rig: PausableRig, drives: Mapping[str, DriveTravel], damping: float, direction: int
    ) -> None:
        self.problems: dict[str, str] = {}
        """What is wrong with a drive; what was found first ends the test."""
        self.watchdogs: dict[str, float] = {}
        """Time from the last command to each drive's own stop [s]."""
        self.longest: dict[str, tuple[float, float]] = {}
        """Travel of the longest stroke as commanded and as the encoder shows it [m]."""
        self._rig = rig
        self._drives = drives
        self._damping = damping
        self._direction = direction
        self._time = 0.0
        self._steps = self._plan()

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Add up what the drives did since the last tick, and go on."""
        dt, self._time = t - self._time, t
        for name, drive in self._drives.items():
            drive.advance(self._rig.applied[AXES.index(name)], measurement, dt)
        velocity = next(self._steps, None)
        self.finished = velocity is None or bool(self.problems)
        return 0.0 if self.finished or velocity is None else self._damping * velocity

    def _plan(self) -> Iterator[float]:
        """The velocity [m/s] at each tick."""
        yield from self._stand(WARM)
        if self._direction:
            for length, seconds in zip(STROKES, STROKE_TIMES, strict=True):
                yield from self._stroke(self._direction, length, seconds)
                self._note_longest()
                self._judge_length(length)
                back = abs(self._drives["slave"].commanded)
                yield from self._stroke(-self._direction, back, seconds)
        self._rig.paused = True
        begun = self._time
        while self._time - begun < SILENCE and len(self.watchdogs) < len(self._drives):
            yield 0.0
            for name in self._rig.stopped():
                self.watchdogs.setdefault(name, self._time - begun)
        for name in self._drives.keys() - self.watchdogs.keys():
            self.problems[name] = f"its watchdog did not act in {SILENCE:g} s without a command"

    def _stand(self, seconds: float) -> Iterator[float]:
        end = self._time + seconds
        while self._time < end:
            yield 0.0

    def _stroke(self, direction: int, length: float, seconds: float) -> Iterator[float]:
        """Go that far [m] in that time [s], or as far as the limits allow, and stand.

        Every tick is judged.
        """
        for drive in self._drives.values():
            drive.begin()
        given_up = self._time + 2.0 * seconds
        while self._time < given_up and abs(self._drives["slave"].commanded) < length:
            yield direction * length / seconds
            self._judge(settled=False)
        for _ in self._stand(SETTLING):
            yield 0.0
            self._judge(settled=False)
        self._judge(settled=True)

    def _judge(self, settled: bool) -> None:
        for name, drive in self._drives.items():
            if problem := drive.problem(settled):
                self.problems.setdefault(name, problem)

    def _note_longest(self) -> None:
        for name, drive in self._drives.items():
            self.longest[name] = (
                abs(drive.commanded),
                math.copysign(1.0, drive.commanded) * drive.moved,
            )

    def _judge_length(self, length: float) -> None:
        """A stroke that the limits cut short proves nothing, and a faster one is not tried."""
        for name, (commanded, _) in self.longest.items():
            if commanded < ENOUGH * length:
                self.problems.setdefault(
                    name,
                    f"the limits let it go {commanded * 1e3:.3f} mm of {length * 1e3:g} mm, "
                    "too little to prove sign and scale: expected a slave that is free to move",
                )


def limits_about(limits: Limits, zero: ForceZero) -> Limits:
    """The limits of a rig, narrowed to where the slave stands; positions count from there.

    Parameters
    ----------
    limits
        Limits of the rig.
    zero
        What its sensors read at rest.

    Raises
    ------
    InputError
        The slave is beyond a hard limit.
    """
    low, high = (end - zero.position for end in limits.hard_position)
    if not low <= 0.0 <= high:
        raise InputError(
            f"slave_position is {zero.position * 1e3:g} mm: expected it within "
            f"hard_position_mm, {limits.hard_position[0] * 1e3:g} to "
            f"{limits.hard_position[1] * 1e3:g} mm"
        )
    hard = max(low, -REACH), min(high, REACH)
    return replace(
        limits,
        soft_position=(0.8 * hard[0], 0.8 * hard[1]),
        hard_position=hard,
        soft_force=min(SOFT_FORCE * limits.hard_force, limits.soft_force),
        hard_force=HARD_FORCE * limits.hard_force,
    )


def check_drives(rig: WiredRig, clock: Clock, move: bool) -> DrivesReport:
    """Let the watchdogs of the drives run out, after strokes forth and back if wanted.

    The drives are enabled at standstill. They are idle afterwards.

    Parameters
    ----------
    rig
        The rig, opened.
    clock
        The clock that paces the test.
    move
        Whether to move.

    Raises
    ------
    InputError
        The rig is not at rest, or stands beyond its hard limits.
    """
    sections = rig.file.sections
    limits, zero = rig_limits(sections), force_zero(rig, clock)
    about = limits_about(limits, zero)
    tested = PausableRig(rig)
    drives = {
        name: DriveTravel(name, sections.channels, limits.drive_compliance)
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
    bank = settings.estimation_preset.bank()
    layout = Layout(bank)
    box = BlackBox(layout, settings.rate)
    controller = make_controller(settings, tested, bank, clock, test)
    try:
        with StopSwitch(key=True) as switch, switch.attended():
            Loop(controller, clock, layout, [box], switch, settings.duration).run()
    finally:
        rig.idle()
    if controller.error and not isinstance(controller.error, RigError):
        raise controller.error
    reports = [
        DriveReport(
            name,
            test.watchdogs.get(name, math.nan),
            *test.longest.get(name, (math.nan, math.nan)),
            test.problems.get(name, ""),
        )
        for name in drives
    ]
    return DrivesReport(reports, box.fault, switch.interrupted)
