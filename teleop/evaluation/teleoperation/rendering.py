"""Compute the stiffness, force and energy that the hand felt in a trial with force feedback."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.quantities import STIFFNESS
from teleop.evaluation.teleoperation.loop_oscillation import (
    ArmDamping,
    RunningSpectra,
)
from teleop.evaluation.teleoperation.thresholds import (
    FEWEST_TICKS,
    LATE_REPORT,
    LEAST_FORCE,
    MOST_PRIOR,
    MOST_SUSTAINED,
    OLDEST_POSITION,
    SETTLING,
    SMALLEST_MOTION,
)
from teleop.recording.recording import Recording


class Rendering(NamedTuple):
    """Stiffness, force error and energy that the hand felt in a trial, and the loop's stability.

    The stiffness and the errors are computed at ticks of the control loop with contact. The first
    `SETTLING` seconds of the trial are omitted. If too few ticks remain, these values are NaN.
    """

    rendered_k: float
    """Secant stiffness that the hand felt [N/m]: the sum of f x divided by the sum of x^2, where f
    is the force that the hand felt and x the position of the hand. On a force-commanded master,
    this is the position of the handle, and not that of the virtual mass."""
    rendered_k_error: float
    """Relative difference between `rendered_k` and its correct value. The correct value is the
    secant stiffness at the slave in the same motion, multiplied by force gain and motion scale, and
    in series with the virtual coupling of a force-commanded master."""
    felt_force_error: float
    """Relative error of the force that the hand felt. The correct force is the contact force of the
    slave in the same motion, multiplied by the force gain. The root mean square error is divided by
    the root mean square of the correct force."""
    energy_min_j: float
    """Smallest value in the trial of the energy that the hand has given to the displayed
    environment since the start [J]. A negative value means that the environment gave energy to the
    hand. The energy in the virtual damping and mass of the admittance is not included."""
    stable: bool | None
    """Whether the trial had no safety stop, and no oscillation of the loop (see
    `teleop.evaluation.teleoperation.loop_oscillation`). A slow instability that has not reached the
    threshold of a stop by the end of the trial is counted as stable. None: the trial had neither,
    but also too little contact to show that the loop is stable."""
    coupling_k: float = math.nan
    """Stiffness of the virtual coupling of a force-commanded master [N/m]; NaN if there is
    none."""
    remarks: tuple[str, ...] = ()
    """Why a value is missing, and what the hand felt instead of the specimen."""


class Hand(NamedTuple):
    """Position, velocity and force at the hand. Each is an array with one value per tick.

    The hand holds the master, which moves like the virtual mass of the admittance.
    """

    position: Floats
    """Position of the virtual mass at the end of each tick [m], relative to the contact point."""
    force: Floats
    """Force of the environment that the hand felt [N]."""
    velocity: Floats
    """Mean velocity of the virtual mass during each tick [m/s]."""


class RunningHand:
    """Computes position, velocity and force at the hand in a recorded trial with force feedback.

    The master is controlled as an admittance: m v' + d v + k x = f_h - f_e. The virtual mass m, the
    virtual damping d and the virtual stiffness k are settings. v is the velocity of the master, x
    its distance from the initial position, and f_h the force of the hand. f_e is the force of the
    environment that the hand feels. It is computed from this equation.

    There is one exception. At some ticks of the control loop, the safety supervisor changed the
    commanded velocity of the master, and the equation does not hold. At these ticks, v is the
    velocity that the drive applied, and f_e is the displayed force in the recording.

    `scale` is slave motion by master motion. The ticks are those at which the drives follow the
    commands.
    """

    def __init__(self, mass: float, damping: float, stiffness: float, scale: float = 1.0) -> None:
        self._mass, self._damping, self._stiffness = mass, damping, stiffness
        self._scale = scale
        self._start: float | None = None
        self._v = self._moved = 0.0

    def add(self, active: Recording) -> Hand:
        """Return position, velocity and force at the hand at the next ticks."""
        if not len(active):
            return Hand(np.empty(0), np.empty(0), np.empty(0))
        desired, dt = active["desired_master_velocity"], active["dt"]
        limited = active["commanded_master_velocity"] != desired
        v = np.where(limited, active["applied_master_velocity"], desired)
        before = np.concatenate(([self._v], v[:-1]))
        mean = np.where(limited, v, 0.5 * (v + before))
        moved = cumulative_sum(mean * dt, self._moved)
        force = active["drive_force"] - self._mass * (v - before) / dt - self._damping * mean
        force -= self._stiffness * (moved - 0.5 * mean * dt)
        force = np.where(limited, active["displayed_force"], force)
        if self._start is None:
            self._start = float(active["slave_position"][0]) / self._scale
        self._v, self._moved = float(v[-1]), float(moved[-1])
        return Hand(self._start + moved, force, mean)


def hand(
    recording: Recording, mass: float, damping: float, stiffness: float, scale: float = 1.0
) -> Hand:
    """Return position, velocity and force at the hand at all ticks of a trial."""
    return RunningHand(mass, damping, stiffness, scale).add(recording)


class RunningRendering:
    """Computes stiffness, force error and energy that the hand felt in a recorded trial.

    Call `add` for each block of ticks at which the drives follow the commands, and then `result`.

    `scale` is slave motion by master motion, `gain` displayed force by contact force, and `end` the
    time of the last tick [s]. `arm_damping` returns the damping of the operator's arm [N s/m] at
    frequencies [Hz]; None if it is not known. `prior` is the stiff first model of the
    model-mediated law at the hand [N/m]; None for another law. `coupling_k` is the stiffness of the
    virtual coupling of a force-commanded master [N/m].
    """

    def __init__(
        self,
        hand: RunningHand,
        scale: float,
        gain: float,
        end: float,
        arm_damping: ArmDamping | None = None,
        prior: float | None = None,
        coupling_k: float = math.inf,
    ) -> None:
        self._coupling_k = coupling_k
        self._hand, self._scale, self._gain = hand, scale, gain
        self._settled = min(SETTLING, 0.5 * end)
        self._spectra = RunningSpectra(arm_damping)
        self._prior = prior
        self._ticks = self._evaluated = self._considered = self._of_prior = 0
        self._deepest = self._strongest = self._oldest_report = 0.0
        self._energy = self._lowest = 0.0
        self._sums = np.zeros(6)
        self._earlier: Floats = np.empty((4, 0))
        """Time, position of the virtual mass, felt force and stretch of the virtual coupling at
        earlier ticks, shape (4, ticks)."""

    def add(self, active: Recording) -> None:
        """Process the next ticks of the trial."""
        if not len(active):
            return
        self._ticks += len(active)
        t, x, f = active["time"], active["slave_position"], self._gain * active["contact_force"]
        felt = self._hand.add(active)
        energy = cumulative_sum(felt.force * felt.velocity * active["dt"], self._energy)
        self._energy, self._lowest = float(energy[-1]), min(self._lowest, float(energy.min()))
        settled = t > self._settled
        self._spectra.add(
            felt.velocity[settled], active["drive_force"][settled], active["dt"][settled]
        )
        part = settled & (np.abs(f) > LEAST_FORCE)
        self._considered += int(settled.sum())
        self._deepest = float(np.max(np.abs(x[settled]), initial=self._deepest))
        self._strongest = float(np.max(np.abs(f[settled]), initial=self._strongest))
        ages = active["report_age"][settled]
        self._oldest_report = float(np.max(ages, initial=self._oldest_report))
        if self._prior is not None:
            displayed = active["model_stiffness"][settled]
            self._of_prior += int(np.isclose(displayed, self._prior).sum())
        stretch = active["drive_force"] / self._coupling_k
        times, positions, forces, stretches = self._earlier = np.concatenate(
            (self._earlier, (t, felt.position, felt.force, stretch)), axis=1
        )
        sent, x, f = (t - active["motion_age"])[part], x[part], f[part]
        position, force, stretch = (
            np.interp(sent, times, values) for values in (positions, forces, stretches)
        )
        position, touched = position + stretch, x / self._scale + stretch
        self._evaluated += len(f)
        self._sums += (
            np.dot(force, position),
            np.dot(position, position),
            np.dot(f, touched),
            np.dot(touched, touched),
            np.sum((force - f) ** 2),
            np.sum(f**2),
        )
        self._earlier = self._earlier[:, times > t[-1] - OLDEST_POSITION]

    def result(self, fault: bool) -> Rendering:
        """Return the stiffness, force error, energy and stability over all processed ticks.

        The parameter `fault` states whether a fault stopped the trial. Such a trial is not stable.
        """
        if not self._ticks:
            return Rendering(math.nan, math.nan, math.nan, math.nan, stable=False)
        stable = not fault and self._spectra.sustained_share() < MOST_SUSTAINED
        count, remarks = self._evaluated, tuple(self._remarks())
        if count < FEWEST_TICKS:
            unknown = None if stable else False
            return Rendering(math.nan, math.nan, math.nan, self._lowest, unknown, remarks=remarks)
        felt, felt_square, touched, touched_square, error, square = self._sums
        with np.errstate(all="ignore"):  # NaN or inf if the hand or the slave did not move
            rendered = float(felt / felt_square)
            difference = float(rendered / (touched / touched_square) - 1.0)
            relative = float(np.sqrt((error / count) / (square / count)))
        coupling = self._coupling_k if self._coupling_k < math.inf else math.nan
        return Rendering(rendered, difference, relative, self._lowest, stable, coupling, remarks)

    def _remarks(self) -> Iterator[str]:
        """Yield why the felt stiffness is missing, and whether the hand felt the stiff prior."""
        if self._evaluated < FEWEST_TICKS:
            yield (
                f"no felt stiffness: after {self._settled:.3g} s, the contact force times the "
                f"force gain was at most {self._strongest:.2g} N and above {LEAST_FORCE:g} N at "
                f"{self._evaluated} ticks: expected {FEWEST_TICKS}"
            )
        elif self._sums[1] == 0.0:
            yield "no felt stiffness: the hand did not move"
        if self._prior is not None and self._of_prior > MOST_PRIOR * self._considered:
            cause = "the misfit or the interval of each estimate was too large"
            if self._oldest_report > LATE_REPORT:
                cause = f"the estimates of the slave were up to {self._oldest_report:.2g} s old"
            elif self._deepest < SMALLEST_MOTION:
                cause = (
                    f"this model kept the motion within {self._deepest * 1e3:.2g} mm, where lost "
                    "motion and noise prevent an estimate"
                )
            yield (
                f"at {self._of_prior / self._considered:.0%} of the ticks the hand felt the stiff "
                f"first model of {STIFFNESS.text(self._prior)} and not the specimen: {cause}"
            )


def cumulative_sum(values: Floats, start: float) -> Floats:
    """Return the cumulative sum of the values plus the number `start`, shape (n,).

    Element i is `start` + values[0] + ... + values[i].
    """
    return np.cumsum(np.concatenate(([start], values)))[1:]
