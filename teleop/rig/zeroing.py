"""Measure the zero offsets of the force sensors of a rig at rest and without load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers import Measurement, Rig
from estimation.arrays import Floats
from teleop.control.clock import Clock
from teleop.control.tare import LARGEST_ZERO
from teleop.errors import InputError
from teleop.safety import Limits

LISTENING = 1.0
"""Time over which the forces are averaged [s]."""
PATIENCE = 5.0
"""Time in which the rig must come to rest [s]."""
REST = 5e-5
"""Largest range of the measured position during `LISTENING` for a slave at rest [m]."""
MAX_NOISE = 0.5
"""Largest standard deviation of the noise of a force sensor without load [N]."""
NEGLIGIBLE_CHANGE = 0.01
"""Change of a force during `LISTENING` that is accepted for any noise, even without noise [N].

The change is the range of the means of the blocks (largest minus smallest mean).
"""
BLOCKS = 20
"""Number of blocks into which the samples of a force are divided, to detect a slow change.

The noise of different blocks must be independent.
"""
LARGEST_RATIO = 5.5
"""Largest ratio of the range of the block means to their moving range, for a constant force.

The range is the largest minus the smallest mean. The moving range is the mean absolute difference
between the means of successive blocks. For independent Gaussian noise, the probability of a larger
ratio is 0.4 %. If the force only increases or only decreases, the ratio is `BLOCKS` - 1.
"""
USUAL_ZERO = 0.01
"""Largest zero offset that is accepted without a question, as a fraction of `full_scale`.

Data sheets of strain-gauge sensors state a zero balance of about 1 % of the rated force.
"""
POSSIBLE_ZERO = 0.1
"""Largest zero offset that is accepted at all, as a fraction of `full_scale`.

If a load is taken for a zero offset, the true force can exceed the force limits by this load.
"""
CHANGE = 0.1
"""Change between two measurements that is accepted, as a fraction of the usual zero offset."""


@dataclass(frozen=True)
class ForceZero:
    """Readings of the sensors of a rig at rest and without load: mean values and noise."""

    master: float
    """Mean of the measured master force [N]."""
    contact: float
    """Mean of the measured contact force [N]."""
    master_noise: float
    """Standard deviation of the measured master force [N]."""
    contact_noise: float
    """Standard deviation of the measured contact force [N]."""
    position: float
    """Mean of the readings of the slave's encoder [m]."""

    @property
    def forces(self) -> dict[str, float]:
        """Mean forces [N], by the name of the sensor."""
        return {"master": self.master, "contact": self.contact}

    @property
    def noise(self) -> dict[str, float]:
        """Standard deviations of the forces [N], by the name of the sensor."""
        return {"master": self.master_noise, "contact": self.contact_noise}


def force_zero(rig: Rig, clock: Clock) -> ForceZero:
    """Wait until the rig is at rest, and measure the zero offsets of the force sensors.

    A zero offset is the mean reading without load over the time `LISTENING`. If the slave moves or
    a force changes during this time, for example because a hand releases the handle, the
    measurement is repeated.
    """
    ticks = round(LISTENING * clock.rate)
    for _ in range(round(PATIENCE / LISTENING)):
        samples: list[Measurement] = []
        for _ in range(ticks):
            clock.wait()
            samples.append(rig.read())
        position = np.array([m.slave_position for m in samples])
        master = np.array([m.master_force for m in samples])
        contact = np.array([m.contact_force for m in samples])
        problem = (
            motion_problem(position)
            or load_problem("master", master)
            or load_problem("contact", contact)
        )
        if not problem:
            return ForceZero(
                float(master.mean()),
                float(contact.mean()),
                float(master.std()),
                float(contact.std()),
                float(position.mean()),
            )
    raise InputError(f"{problem} (after {PATIENCE:g} s of waiting)")


def confirmed_zero(
    measure: Callable[[], ForceZero], limits: Limits, confirm: Callable[[str], bool]
) -> ForceZero | None:
    """Measure the zero offsets; measure again after a person has confirmed a large offset.

    The result is None if `confirm` returned False.

    A constant load looks like a zero offset. An offset that is larger than usual is therefore
    accepted only if a person confirms that nothing loads the sensor, and if a second measurement
    gives the same offset, or an offset of the usual size.
    """
    first = measure()
    check_possible(first, limits)
    unusual = unusual_zeros(first, limits)
    if not unusual:
        return first
    if not confirm("; ".join(unusual.values())):
        return None
    second = measure()
    check_possible(second, limits)
    for name in unusual_zeros(second, limits):
        before, after = first.forces[name], second.forces[name]
        noise = max(first.noise[name], second.noise[name])
        if not abs(after - before) <= max(CHANGE * USUAL_ZERO * full_scale(limits, name), noise):
            raise InputError(
                f"the {name} force sensor reads {after:.2f} N, and {before:.2f} N before: expected "
                "the same without load"
            )
    return second


def unusual_zeros(zero: ForceZero, limits: Limits) -> dict[str, str]:
    """Return texts about the zero offsets that may be loads, by the name of the sensor."""
    usual = {name: USUAL_ZERO * full_scale(limits, name) for name in zero.forces}
    return {
        name: f"the {name} force sensor reads {force:.2f} N, without load usually at most "
        f"{usual[name]:.2g} N"
        for name, force in zero.forces.items()
        if not abs(force) <= usual[name]
    }


def check_possible(zero: ForceZero, limits: Limits) -> None:
    """Raise InputError if a zero offset is larger than `POSSIBLE_ZERO` permits."""
    for name, force in zero.forces.items():
        largest = POSSIBLE_ZERO * full_scale(limits, name)
        if not abs(force) <= largest:
            raise InputError(
                f"the {name} force sensor reads {force:.2f} N: expected no load, and a zero within "
                f"{largest:.2g} N, {POSSIBLE_ZERO:.0%} of its range or of hard_force_n (for the "
                f"weight of a tool, set offset_n of channels.{name}_force)"
            )


def full_scale(limits: Limits, name: str) -> float:
    """Return the largest force that a sensor of the rig measures in normal operation [N].

    It is the smaller one of the range of the sensor `name` and the hard limit of the contact force.
    """
    channel = limits.channels[f"{name}_force"]
    return min(max(-channel.low, channel.high), limits.hard_force)


def motion_problem(position: Floats) -> str:
    """Return a text that describes the motion of the slave; empty if the slave is at rest.

    `position` is the measured position of the slave [m], shape (n,).
    """
    if np.ptp(position) <= REST:
        return ""
    return (
        f"the slave moves by {np.ptp(position) * 1e3:.3f} mm in {LISTENING:g} s: expected it to be "
        "at rest"
    )


def load_problem(name: str, force: Floats) -> str:
    """Return a text that describes the load on a force sensor; empty if no load is detected.

    A large mean force or a large standard deviation is treated as a load. A load that changes
    slowly is detected as follows. The samples are divided into `BLOCKS` blocks, and the mean force
    of each block is computed. The range of these means is the largest minus the smallest mean.
    Their moving range is the mean absolute difference between the means of successive blocks. Noise
    increases the range and the moving range. A slow change or a single step increases mainly the
    range. A load is therefore detected if the range is much larger than the moving range.

    A constant load cannot be distinguished from a zero offset, see `confirmed_zero`.
    """
    if not abs(force.mean()) <= LARGEST_ZERO:
        return (
            f"the {name} force sensor reads {force.mean():.2f} N: expected no load, and a zero "
            f"within {LARGEST_ZERO:g} N"
        )
    if not force.std() <= MAX_NOISE:
        return (
            f"the {name} force varies by {force.std():.2f} N rms: expected noise of at most "
            f"{MAX_NOISE:g} N"
        )
    means = np.array([block.mean() for block in np.array_split(force, BLOCKS)])
    change, moving_range = float(np.ptp(means)), float(np.mean(np.abs(np.diff(means))))
    if change <= max(LARGEST_RATIO * moving_range, NEGLIGIBLE_CHANGE):
        return ""
    return (
        f"the {name} force changes by {change:.3f} N in {LISTENING:g} s, more than its noise "
        "explains: expected a rig at rest and no hand on the handle"
    )
