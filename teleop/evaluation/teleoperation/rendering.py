"""Compute the stiffness, damping, force and energy that the hand felt with force feedback.

The hand feels the force F of the displayed environment at its position p. F is compared with the
force of the tissue in the same motion of the hand, F_t(p). The law of the tissue is fitted to the
position of the tip and the contact force:

    f = k x + k3 x^3 + b v

The position of the tip is that of the encoder, without the lost motion and the compliance of the
calibrated transmission. Compared with a position at the encoder, an error that lost motion causes
would cancel: both would have the same error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.filters import Lag, Play
from estimation.quantities import STIFFNESS
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.evaluation.teleoperation.loop_oscillation import (
    NO_OSCILLATION,
    ArmDamping,
    LoopOscillation,
    RunningSpectra,
)
from teleop.evaluation.teleoperation.thresholds import (
    BEHIND,
    BLOCK,
    FEWEST_BLOCKS,
    LATE_REPORT,
    LEAST_FORCE,
    LEAST_POWER,
    MOST_BLOCKS,
    MOST_PRIOR,
    MOST_TISSUE_MISFIT,
    NOTICEABLE,
    SEGMENT,
    SETTLING,
    SMALLEST_MOTION,
)
from teleop.recording.recording import Recording
from teleop.vibration import detectable


class Rendering(NamedTuple):
    """What the hand felt in a trial, compared with the tissue, and the stability of the loop.

    The values are those of the motion in contact. The first `SETTLING` seconds of the trial are
    omitted. If too little contact remains, they are NaN. The correct values are those of the tissue
    in the motion of the hand, multiplied by force gain and motion scale, and in series with the
    virtual coupling of a force-commanded master.
    """

    rendered_k: float = math.nan
    """Secant stiffness that the hand felt [N/m]: the sum of F p divided by the sum of p^2. On a
    force-commanded master, p is the position of the handle, and not that of the virtual mass."""
    rendered_k_error: float = math.nan
    """Relative difference between `rendered_k` and its correct value."""
    rendered_b: float = math.nan
    """Damping that the hand felt [N s/m]: b in the fit of F = k p + k3 p^3 + b p'."""
    tissue_b: float = math.nan
    """Correct value of `rendered_b` [N s/m]."""
    felt_force_error: float = math.nan
    """Relative error of the force that the hand felt against that of the tissue in the motion of
    the hand. The root mean square error is divided by the root mean square of the correct force."""
    contact_force_error: float = math.nan
    """Relative error of the force that the hand felt against the measured contact force. It
    contains the error of the position of the tip."""
    bandwidth_hz: float = math.nan
    """Transparency bandwidth: frequency up to which the impedance that the hand felt differs by
    less than `NOTICEABLE` from that of the tissue [Hz]."""
    evaluated_hz: float = math.nan
    """Highest frequency at which the hand moved enough to compare the impedances [Hz]."""
    energy_min_j: float = math.nan
    """Smallest value in the trial of the energy that the hand has given to the displayed
    environment since the start [J]. A negative value means that the environment gave energy to the
    hand. The energy in the virtual damping and mass of the admittance is not included."""
    outcome: str = "not known"
    """`stable`; `sustained oscillation`: the loop moves the hand by more than tremor does, and by
    more than the fingers detect; `diverging`: the trial ended in a stop by the observer of
    oscillations or of energy; `stopped: ...`: a stop by another fault; or `not known`: too little
    contact."""
    oscillation_m: float = 0.0
    """Amplitude of the motion of the hand that the loop sustains [m]."""
    oscillation_hz: float = math.nan
    """Frequency of this motion [Hz]; NaN if there is none."""
    detectable_m: float = math.nan
    """Smallest amplitude that the fingers detect at this frequency, about [m]."""
    tremor_m: float = math.nan
    """Amplitude of the other motion of the hand above 4 Hz, such as tremor [m]."""
    coupling_k: float = math.nan
    """Stiffness of the virtual coupling of a force-commanded master [N/m]; NaN if there is
    none."""
    force_source: str = "the motion of the virtual mass"
    """From what the force that the hand felt is computed."""
    remarks: tuple[str, ...] = ()
    """Why a value is missing, and what the hand felt instead of the specimen."""

    @property
    def stable(self) -> bool | None:
        """Whether the loop was stable; None if the trial does not show it."""
        if self.outcome in ("diverging", "sustained oscillation"):
            return False
        return True if self.outcome == "stable" else None


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


class Blocks(NamedTuple):
    """Means over short blocks of ticks. Each is an array with one value per block."""

    time: Floats
    """Time at the end of the block [s]."""
    sent: Floats
    """Time at which the master sent the motion that the slave follows [s]."""
    handle: Floats
    """Position of the handle [m]."""
    handle_velocity: Floats
    """Velocity of the handle [m/s]."""
    felt: Floats
    """Force of the environment that the hand felt [N]."""
    tip: Floats
    """Position of the tip of the slave, with the lag of the contact force [m]."""
    tip_velocity: Floats
    """Velocity of the tip [m/s]."""
    force: Floats
    """Contact force [N]."""
    sent_handle: Floats
    """Position of the handle at the time `sent` [m]."""
    sent_felt: Floats
    """Force that the hand felt at the time `sent` [N]."""


class Comparison(NamedTuple):
    """Force that the hand felt in its motion, and the force of the tissue in the same motion."""

    position: Floats
    """Position of the handle [m]."""
    velocity: Floats
    """Velocity of the handle [m/s]."""
    felt: Floats
    """Force that the hand felt [N]."""
    correct: Floats
    """Force of the tissue in the motion of the hand [N]."""
    tissue_misfit: float
    """Relative rms error of the law of the tissue."""
    damping: float
    """Damping in the law of the tissue, at the slave [N s/m]."""
    damping_error: float
    """Standard deviation of this damping [N s/m]."""

    def impedance_error(self) -> tuple[Floats, Floats]:
        """Return frequencies [Hz] and the relative error of the impedance at each of them.

        The impedance is that which the hand felt, and its error is relative to that of the tissue.
        Frequencies at which the hand moves too little are omitted.
        """
        length = round(SEGMENT / BLOCK)
        if len(self.felt) < length:
            return np.empty(0), np.empty(0)
        windows = np.lib.stride_tricks.sliding_window_view
        v, felt, correct = (
            np.fft.rfft(np.hanning(length) * windows(one, length)[:: length // 2], axis=1)
            for one in (self.velocity, self.felt, self.correct)
        )
        power = np.sum(np.abs(v) ** 2, axis=0)
        frequency = np.fft.rfftfreq(length, BLOCK).astype(np.float64)
        used = (power > LEAST_POWER * power.max()) & (frequency > 0.0)
        difference = np.abs(np.sum((felt - correct) * v.conj(), axis=0))
        of_tissue = np.abs(np.sum(correct * v.conj(), axis=0))
        return frequency[used], (difference / np.maximum(of_tissue, 1e-12))[used]

    def bandwidth(self) -> tuple[float, float]:
        """Return the frequency up to which a person does not notice the error, and the highest one.

        Both are in Hz. The second one is the highest frequency that was evaluated.
        """
        frequency, error = self.impedance_error()
        wrong = error > NOTICEABLE
        twice = np.flatnonzero(wrong[:-1] & wrong[1:])  # one frequency can be noise
        count = int(twice[0]) if len(twice) else len(error)
        highest = float(np.max(frequency, initial=0.0))
        return float(frequency[count - 1]) if count else math.nan, highest


class RunningRendering:
    """Computes what the hand felt in a recorded trial.

    Call `add` for each block of ticks at which the drives follow the commands, and then `result`.

    `scale` is slave motion by master motion, `gain` displayed force by contact force, and `end` the
    time of the last tick [s]. `arm_damping` returns the damping of the operator's arm [N s/m] at
    frequencies [Hz]; None if it is not known. `prior` is the stiff first model of the
    model-mediated law at the hand [N/m]; None for another law. `coupling_k` is the stiffness of the
    virtual coupling of a force-commanded master [N/m]. `transmission` is that of the slave; None if
    it is not known. If the body is not `glued`, it does not pull.
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
        transmission: TransmissionCalibration | None = RIGID,
        glued: bool = True,
    ) -> None:
        self._coupling_k = coupling_k
        self._hand, self._scale, self._gain, self._glued = hand, scale, gain, glued
        self._settled = min(SETTLING, 0.5 * end)
        self._spectra = RunningSpectra(arm_damping)
        self._prior = prior
        self._is_calibrated = transmission is not None
        known = transmission or RIGID
        self._play, self._lag = Play(known.lost_motion), Lag(known.force_lag)
        self._compliance = known.compliance
        self._ticks = self._considered = self._of_prior = 0
        self._oldest_report = 0.0
        self._energy = self._lowest = 0.0
        self._size = 0
        self._pending: Floats = np.empty((8, 0))
        self._means: list[Floats] = []
        self._count = 0
        self._is_cut = False

    def add(self, active: Recording) -> None:
        """Process the next ticks of the trial."""
        if not len(active):
            return
        self._ticks += len(active)
        t, dt, f = active["time"], active["dt"], active["contact_force"]
        felt = self._hand.add(active)
        energy = cumulative_sum(felt.force * felt.velocity * dt, self._energy)
        self._energy, self._lowest = float(energy[-1]), min(self._lowest, float(energy.min()))
        settled = t > self._settled
        self._spectra.add(felt.velocity[settled], active["drive_force"][settled], dt[settled])
        self._considered += int(settled.sum())
        ages = active["report_age"][settled]
        self._oldest_report = float(np.max(ages, initial=self._oldest_report))
        if self._prior is not None:
            displayed = active["model_stiffness"][settled]
            self._of_prior += int(np.isclose(displayed, self._prior).sum())
        # without the stretch that moves virtual mass and damping, which are no part of the tissue
        handle_end = felt.position + felt.force / self._coupling_k
        handle = handle_end - 0.5 * felt.velocity * dt  # the force is the mean over the tick
        tip = self._lag.run(self._play.run(active["slave_position"]), dt) - self._compliance * f
        if not self._glued:
            tip = np.maximum(tip, 0.0)
        if not self._size:
            self._size = max(1, round(BLOCK / float(np.median(dt))))
        ticks = np.stack((t, t - active["motion_age"], handle, felt.force, tip, f, dt, handle_end))
        self._pending = np.concatenate((self._pending, ticks), axis=1)
        count = self._pending.shape[1] // self._size * self._size
        parts = self._pending[:, :count].reshape(8, -1, self._size)
        self._pending = self._pending[:, count:]
        last, means = parts[:, :, -1], parts.mean(axis=2)
        span = parts[6].sum(axis=1)
        self._means.append(np.stack((last[0], *means[1:6], span, last[7], last[4])))
        self._count += means.shape[1]
        while self._count - self._means[0].shape[1] >= MOST_BLOCKS:
            self._count -= self._means.pop(0).shape[1]
            self._is_cut = True

    def blocks(self) -> Blocks:
        """Return the means over all blocks after the first seconds."""
        empty = np.empty((9, 0))
        t, sent, handle, felt, tip, f, span, handle_end, tip_end = np.concatenate(
            self._means or [empty], axis=1
        )
        if not len(t):
            return Blocks(*[t] * 10)
        handle_velocity = np.diff(handle_end, prepend=handle_end[:1]) / span
        tip_velocity = np.diff(tip_end, prepend=tip_end[:1]) / span
        earlier = np.interp(sent, t, handle), np.interp(sent, t, felt)
        part = t > self._settled
        moved = (t, sent, handle, handle_velocity, felt, tip, tip_velocity, f, *earlier)
        return Blocks(*(values[part] for values in moved))

    def comparison(self, blocks: Blocks) -> Comparison | None:
        """Return the force that the hand felt beside that of the tissue in the same motion.

        None if there is too little contact to fit the law of the tissue.
        """
        contact = self._gain * np.abs(blocks.force) > LEAST_FORCE
        if np.count_nonzero(contact) < FEWEST_BLOCKS:
            return None
        terms, force = law_terms(blocks.tip, blocks.tip_velocity)[contact], blocks.force[contact]
        size = np.linalg.norm(terms, axis=0) + 1e-30
        law = np.linalg.lstsq(terms / size, force, rcond=1e-9)[0] / size
        misfit = float(np.linalg.norm(force - terms @ law) / np.linalg.norm(force))
        p, v = blocks.handle, blocks.handle_velocity
        correct = self._in_series(law, p, v)
        noise = misfit * float(np.linalg.norm(force)) / math.sqrt(len(force))
        spread = np.linalg.pinv(terms.T @ terms / np.outer(size, size))[2, 2]
        deviation = noise * math.sqrt(max(float(spread), 0.0)) / float(size[2])
        return Comparison(p, v, blocks.felt, correct, misfit, float(law[2]), deviation)

    def _in_series(self, law: Floats, p: Floats, v: Floats) -> Floats:
        """Return the force of the tissue at the hand, in series with the virtual coupling [N].

        The virtual mass is at r, with r + F(r) / K = p.
        """
        gain, scale = self._gain, self._scale
        k, k3, b = law
        damping, r = gain * scale * b * v, p.copy()
        if self._coupling_k < math.inf:
            for _ in range(30):  # Newton's method
                elastic = gain * (k + k3 * (scale * r) ** 2) * scale * r + damping
                slope = gain * (k + 3.0 * k3 * (scale * r) ** 2) * scale
                r -= (r + elastic / self._coupling_k - p) / (1.0 + slope / self._coupling_k)
        force = gain * (k + k3 * (scale * r) ** 2) * scale * r + damping
        return force if self._glued else np.where(r > 0.0, np.maximum(force, 0.0), 0.0)

    def result(self, fault: str = "", diverged: bool = False) -> Rendering:
        """Return what the hand felt, and the stability.

        `fault` is that which ended the trial, and `diverged` whether an unstable loop caused it.
        """
        oscillation = self._spectra.result() if self._ticks else NO_OSCILLATION
        blocks = self.blocks()
        found = self.comparison(blocks)
        used = np.abs(found.correct) > LEAST_FORCE if found else np.empty(0, dtype=bool)
        compared = found is not None and int(np.count_nonzero(used)) >= FEWEST_BLOCKS
        rendering = Rendering(
            energy_min_j=self._lowest if self._ticks else math.nan,
            outcome=outcome(fault, diverged, oscillation, compared),
            oscillation_m=oscillation.amplitude,
            oscillation_hz=oscillation.frequency,
            detectable_m=detectable(oscillation.frequency) if oscillation.share else math.nan,
            tremor_m=oscillation.tremor,
            coupling_k=self._coupling_k if self._coupling_k < math.inf else math.nan,
            force_source=Rendering().force_source
            if self._coupling_k == math.inf
            else "the force of the motor",
            remarks=tuple(self._remarks(blocks, found, int(np.count_nonzero(used)))),
        )
        if not compared or found is None:
            return rendering
        p, v, felt, correct, *_ = found
        square = float(p[used] @ p[used])
        if square == 0.0:
            return rendering
        terms = law_terms(p, v)[used]
        terms_size = np.linalg.norm(terms, axis=0) + 1e-30
        fits = np.linalg.lstsq(terms / terms_size, np.stack((felt, correct), 1)[used], rcond=1e-9)
        (rendered_b, tissue_b) = fits[0][2] / terms_size[2]
        contact = self._gain * np.abs(blocks.force) > LEAST_FORCE
        bandwidth, highest = found.bandwidth()
        return rendering._replace(
            rendered_k=float(felt[used] @ p[used]) / square,
            rendered_k_error=float(felt[used] @ p[used] / (correct[used] @ p[used]) - 1.0),
            rendered_b=float(rendered_b),
            tissue_b=float(tissue_b),
            felt_force_error=relative_error(felt[used], correct[used]),
            contact_force_error=relative_error(
                blocks.sent_felt[contact], self._gain * blocks.force[contact]
            ),
            bandwidth_hz=bandwidth,
            evaluated_hz=highest,
        )

    def _remarks(self, blocks: Blocks, found: Comparison | None, count: int) -> Iterator[str]:
        """Yield why values are missing, and what limits the comparison."""
        if count < FEWEST_BLOCKS:
            strongest = self._gain * float(np.max(np.abs(blocks.force), initial=0.0))
            yield (
                f"no felt stiffness: after {self._settled:.3g} s, the contact force times the "
                f"force gain was at most {strongest:.2g} N, and the force of the tissue in the "
                f"motion of the hand was above {LEAST_FORCE:g} N for {count * BLOCK:.2g} s: "
                f"expected {FEWEST_BLOCKS * BLOCK:g} s"
            )
        elif found and not found.position.any():
            yield "no felt stiffness: the hand did not move"
        if self._prior is not None and self._of_prior > MOST_PRIOR * self._considered:
            deepest = float(np.max(np.abs(blocks.tip), initial=0.0))
            cause = "the misfit or the interval of each estimate was too large"
            if self._oldest_report > LATE_REPORT:
                cause = f"the estimates of the slave were up to {self._oldest_report:.2g} s old"
            elif deepest < SMALLEST_MOTION:
                cause = (
                    f"this model kept the motion within {deepest * 1e3:.2g} mm, where noise "
                    "prevents an estimate"
                )
            yield (
                f"at {self._of_prior / self._considered:.0%} of the ticks the hand felt the stiff "
                f"first model of {STIFFNESS.text(self._prior)} and not the specimen: {cause}"
            )
        if found is None or count < FEWEST_BLOCKS:
            return
        if self._is_cut:
            yield (
                "the felt stiffness is that of the last "
                f"{self._count * BLOCK / 60.0:.0f} min: expected a shorter trial"
            )
        if found.tissue_misfit > MOST_TISSUE_MISFIT:
            yield (
                "the force at the slave is not one function of depth and speed (misfit "
                f"{found.tissue_misfit:.0%}): the specimen changed, relaxed or was left, or the "
                "lost motion is wrong; the errors are those against its mean"
            )
        if found.damping < -3.0 * found.damping_error:
            yield (
                f"the damping of the tissue is negative ({found.damping:.2g} N s/m): the lag or "
                "the lost motion of the slave is wrong, and so is what the hand felt"
            )
        if not self._is_calibrated:
            yield (
                "the transmission of the slave is not calibrated: the stiffness is that at the "
                "encoder, in series with the transmission"
            )
        elif self._compliance == 0.0:
            yield (
                "the compliance of the slave's transmission is not calibrated: the stiffness is "
                "that in series with the transmission"
            )
        contact = np.abs(blocks.force) * self._gain > LEAST_FORCE
        at_slave = self._scale * blocks.sent_handle[contact]
        if (
            self._coupling_k == math.inf
            and (behind := relative_error(at_slave, blocks.tip[contact])) > BEHIND
        ):
            yield (
                f"the tip did not follow the hand (difference {behind:.0%} of the depth): a limit "
                "of the slave reduced its motion"
            )


def outcome(fault: str, diverged: bool, oscillation: LoopOscillation, compared: bool) -> str:
    """Return in words how the loop behaved; `compared`: whether there was enough contact."""
    if diverged:
        return "diverging"
    felt = oscillation.share and oscillation.amplitude > detectable(oscillation.frequency)
    if felt and oscillation.amplitude > oscillation.tremor:
        return "sustained oscillation"
    if fault:
        return f"stopped: {fault}"
    return "stable" if compared else "not known"


def law_terms(x: Floats, v: Floats) -> Floats:
    """Return the terms x, x^3 and v of the force of the tissue, shape (n, 3)."""
    return np.stack((x, x**3, v), axis=1)


def relative_error(values: Floats, correct: Floats) -> float:
    """Return the root mean square error divided by the root mean square of the correct values."""
    size = float(np.linalg.norm(correct))
    return float(np.linalg.norm(values - correct)) / size if size > 0.0 else math.nan


def cumulative_sum(values: Floats, start: float) -> Floats:
    """Return the cumulative sum of the values plus the number `start`, shape (n,).

    Element i is `start` + values[0] + ... + values[i].
    """
    return np.cumsum(np.concatenate(([start], values)))[1:]
