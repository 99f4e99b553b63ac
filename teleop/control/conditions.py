"""Control conditions. Each class states all that distinguishes one condition from the others.

Another package adds a condition by an entry point of the group `teleop.conditions`. To add one to
this package, write a class here, and add its name to `CONDITIONS` and to
`teleop.names.ConditionName`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

from drivers import Measurement
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.control.admittance import AdmittanceParameters
from teleop.control.designed_excitation import Design, DesignedInjector
from teleop.control.excitation_signals import Designed, Signal
from teleop.control.injector import Injector, ramp_time
from teleop.control.target import Target


@dataclass(frozen=True)
class IntendedMotion:
    """Settings of a trial that determine the intended motion of the slave."""

    signal: Signal | Designed
    depth: float
    """Largest displacement of the slave [m]."""
    count_in: float
    """Time at the start in which a target does not move [s]."""
    duration: float
    """Duration of the trial [s]."""
    admittance: AdmittanceParameters
    scale: float
    """Ratio of the motion of the slave to the motion of the master."""
    transmission: TransmissionCalibration = RIGID
    """Known lost motion and compliance between the encoder and the tip of the slave."""
    resolution: float = 0.0
    """Smallest change of position that the encoder of the slave measures [m]."""
    design: Callable[[], Design] | None = None
    """Returns what the choice of an excitation during the trial needs to know."""


class Condition(ABC):
    """Base class of control conditions, which compute the force that moves the master.

    The attributes and methods below have values for a condition without special properties, so that
    a class of the user needs `drive_force` only.
    """

    instruction: ClassVar[str] = ""
    """Instruction to the person, shown on the live page while the drives are active."""
    moved_by: ClassVar[Literal["hand", "injector"]] = "hand"
    """What moves the master. With `injector`, nobody holds the handle."""
    signal_kinds: ClassVar[tuple[str, ...]] = ("sine", "multisine", "chirp", "ramp-hold")
    """Kinds of excitation signal that the condition accepts. A condition that accepts all of these
    also accepts signals of other packages."""
    default_frequency: ClassVar[float] = 2.0
    """Frequency of the sine if the settings have no signal [Hz]."""

    note = ""
    """Latest statement about the motion, which is shown and recorded."""
    finished = False
    """Whether the condition has finished. The trial then ends, even before its full duration."""
    ending = ""
    """Reason why the condition has finished before its purpose was reached; empty if it was."""
    phase = math.nan
    """Number of the present step of a protocol, from 0; NaN in a condition without steps."""

    def prepare(self, motion: IntendedMotion) -> None:  # noqa: B027
        """Prepare a trial with these settings. It is called once, before the first tick."""

    def target_for(self, motion: IntendedMotion) -> Target | None:
        """Return the target that the person follows in a trial; None if there is none."""
        return None

    def is_free(self, motion: IntendedMotion) -> bool:
        """Return whether a person chooses the motion."""
        return self.moved_by == "hand" and self.target_for(motion) is None

    def motion_texts(self, motion: IntendedMotion) -> dict[str, str]:
        """Return texts by name that describe the intended motion in a report."""
        return {"depth": f"{motion.depth * 1e3:.4g} mm"}

    def averaged_times(self, motion: IntendedMotion) -> tuple[float, float, str]:
        """Return which part of a trial the averages of the estimates use.

        The result contains the start and the end of this part [s] after the drives were armed, and
        a description of what is left out, which is empty for the whole trial.
        """
        return -math.inf, math.inf, ""

    @abstractmethod
    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force that moves the master, by acting on its virtual mass [N].

        Parameters
        ----------
        t
            Time since the drives were armed [s].
        measurement
            Measurement of this tick.
        """

    def target(self, t: float) -> float:
        """Return the position to which the operator should move the slave.

        Parameters
        ----------
        t
            Time since the drives were armed [s].

        Returns
        -------
        position
            Target position of the slave [m]; NaN if the condition has no target.
        """
        return math.nan


class Teleoperation(Condition):
    """Control condition `free`: the force of the operator moves the master."""

    instruction = "palpate freely"

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the measured force of the operator's hand on the handle [N]."""
        return measurement.master_force


class Mimicry(Teleoperation):
    """Control condition `mimic`: the operator follows a moving target with the slave."""

    instruction = "follow the target with the slave"
    signal_kinds = ("sine",)
    default_frequency = 1.0

    def prepare(self, motion: IntendedMotion) -> None:
        """Take the target of this trial."""
        self._target = self.target_for(motion)

    def target_for(self, motion: IntendedMotion) -> Target:
        """Return the sinusoidal target of a trial."""
        return Target(motion.signal.highest, motion.depth, motion.count_in)

    def motion_texts(self, motion: IntendedMotion) -> dict[str, str]:
        """Return descriptions of the depth, the target and the count-in."""
        target = self.target_for(motion)
        low, high = (1e3 * depth for depth in (target.position(0.0), target.depth))
        return super().motion_texts(motion) | {
            "target": f"sine of {target.frequency:g} Hz, from {low:.4g} to {high:.4g} mm",
            "count-in": f"{target.count_in:g} s",
        }

    def averaged_times(self, motion: IntendedMotion) -> tuple[float, float, str]:
        """Leave out the count-in: without motion, b and k cannot be identified."""
        if not motion.count_in:
            return super().averaged_times(motion)
        return motion.count_in, math.inf, f"the count-in of {motion.count_in:g} s"

    def target(self, t: float) -> float:
        """Return the target position of the slave [m], t [s] after the drives were armed."""
        return self._target.position(t)


class Followed(Condition):
    """Condition of a slave station: the master at the other station moves."""

    instruction = "the master at the other station moves the slave"

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return 0: there is no master here [N]."""
        return 0.0


class Autonomous(Condition):
    """Control condition `autonomous`: the PE injector moves the slave along a known signal."""

    instruction = "the controller moves the slave; leave the handle free"
    moved_by = "injector"
    signal_kinds = (*Condition.signal_kinds, "designed")

    def prepare(self, motion: IntendedMotion) -> None:
        """Create the injector for the signal of this trial."""
        signal, admittance, scale = motion.signal, motion.admittance, motion.scale
        self._injector: Injector | DesignedInjector
        if isinstance(signal, Designed):
            assert motion.design
            self._injector = DesignedInjector(motion.design(), admittance, scale, motion.duration)
        else:
            self._injector = Injector(signal, motion.depth, admittance, scale, motion.duration)

    @property
    def note(self) -> str:  # type: ignore[override]
        """Latest choice of a designed excitation; empty for another signal."""
        return self._injector.note

    def motion_texts(self, motion: IntendedMotion) -> dict[str, str]:
        """Return descriptions of the depth and of the excitation signal."""
        return super().motion_texts(motion) | {"signal": motion.signal.text}

    def averaged_times(self, motion: IntendedMotion) -> tuple[float, float, str]:
        """Leave out the ramp at the end, in which the excitation decreases to zero."""
        ramp = ramp_time(motion.duration)
        text = f"the ramp of the excitation to zero, the last {ramp:g} s"
        return -math.inf, motion.duration - ramp, text

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force [N] with which the slave follows the excitation signal."""
        self._injector.observe(t, measurement)
        return self._injector.force(t)


CONDITIONS: dict[str, type[Condition]] = {
    "free": Teleoperation,
    "mimic": Mimicry,
    "autonomous": Autonomous,
}
"""Control conditions by the name in the settings."""
BY_HAND = tuple(name for name, one in CONDITIONS.items() if one.moved_by == "hand")
"""Names of the conditions in which a person holds the handle."""
