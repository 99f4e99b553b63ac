"""Records of `interval_coverage.py`: a transmission, with a spring and with tissue.

The physics is that of `independent_bodies.py`, which shares no code with the package. A
transmission of the fitted form has play of half width d, then a compliance c in series; the force
channel has a pure delay, a lag of first order, or both in series.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import independent_bodies as physics
import numpy as np
from independent_bodies import Array, Linear, Relaxing, Viscous
from independent_kinds import Draw, Link, Log
from numpy.random import Generator
from scipy.signal import lfilter

SPRING_RATE = 20_000.0
"""Lowest rate of the simulation of a spring [Hz]."""
BEFORE = 0.5
"""Time of the motion before the record starts [s]."""
TABLE = 4000
"""Number of depths at which the law of a body is computed before its simulation."""


class Transmission(NamedTuple):
    """The true transmission of a rig."""

    lag: float
    """Delay plus time constant of the force channel [s]."""
    share: float
    """Share of the pure delay in the lag."""
    lost_motion: float
    """Half width of the play, or friction times compliance [m]."""
    compliance: float
    form: str = "play"
    """`play`, or the form of a `Slider`."""

    @property
    def slider(self) -> physics.Slider:
        """The slider with friction, for all forms except play."""
        lost = self.lost_motion
        return physics.Slider(self.form, lost / self.compliance, self.compliance, 0.3 * lost)


def sensed(rig: Transmission, f: Array, dt: float) -> Array:
    """Return the force behind the lag of its channel."""
    if delay := rig.share * rig.lag:
        t = np.arange(len(f)) * dt
        f = np.interp(t - delay, t, f)
    if constant := (1.0 - rig.share) * rig.lag:
        f = first_order(f, dt, constant)
    return f


def first_order(u: Array, dt: float, tau: float) -> Array:
    """Return the output of a lag; exact if the input is linear between samples."""
    decay, ratio = math.exp(-dt / tau), tau / dt
    now = 1.0 - ratio * (1.0 - decay)
    return u[0] + np.asarray(lfilter([now, 1.0 - now - decay], [1.0, -decay], u - u[0]))


def log_uniform(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


# Records of a spring


class Motion(NamedTuple):
    """A motion on a spring, and the highest frequency that it contains [Hz]."""

    x: Callable[[Generator, Array, float], Array]
    """Position relative to the amplitude, from random numbers, time and duration."""
    highest: float


def one_sine(rng: Generator, t: Array, seconds: float) -> Array:
    return np.sin(2.0 * math.pi * rng.uniform(1.0, 4.0) * t)


def two_sines(rng: Generator, t: Array, seconds: float) -> Array:
    """Return a sine whose amplitude falls to 20 to 40 % in the middle of the record."""
    frequency = round(rng.uniform(1.5, 4.0) * seconds) / seconds
    rest = rng.uniform(0.2, 0.4)
    share = 0.5 + 0.5 * np.tanh((t - 0.5 * seconds) / 0.1)
    return (1.0 - (1.0 - rest) * share) * np.sin(2.0 * math.pi * frequency * t)


def chirp(rng: Generator, t: Array, seconds: float) -> Array:
    first, last = rng.uniform(0.5, 1.5), rng.uniform(5.0, 8.0)
    return np.sin(2.0 * math.pi * (first * t + 0.5 * (last - first) * t**2 / seconds))


def multi_sine(rng: Generator, t: Array, seconds: float) -> Array:
    frequencies = (rng.uniform(0.7, 1.4) * np.array([1.0, 1.73, 2.6, 3.9])).tolist()
    return physics.multi_sine(t, frequencies, rng.uniform(0.0, 2.0 * math.pi, 4).tolist())


def hand(rng: Generator, t: Array, seconds: float) -> Array:
    """Return the motion of a hand with its tremor."""
    tremor = np.sin(2.0 * math.pi * rng.uniform(7.0, 9.0) * t)
    return physics.hand(rng, t, 0.4, 3.0) + rng.uniform(0.01, 0.05) * tremor


MOTIONS = {
    "sine": Motion(one_sine, 4.0),
    "two amplitudes": Motion(two_sines, 4.0),
    "chirp": Motion(chirp, 8.0),
    "multi-sine": Motion(multi_sine, 5.5),
    "hand": Motion(hand, 9.0),
}


@dataclass(frozen=True)
class SpringRecord:
    """A record of a reference spring, and its truth."""

    log: Log
    stiffness: float
    """Stiffness of the spring [N/m]."""
    transmission: Transmission


def drawn_transmission(
    rng: Generator, amplitude: float, stiffness: float, form: str
) -> Transmission:
    """Return a transmission that suits a spring."""
    return Transmission(
        log_uniform(rng, 1e-3, 8e-3),
        float(rng.choice([0.0, 1.0, rng.uniform()])),
        amplitude * rng.uniform(0.01, 0.06),
        rng.uniform(0.02, 0.2) / stiffness,
        form,
    )


def spring_record(
    rng: Generator,
    motion: str,
    rate: float,
    transmission: Transmission | None = None,
    amplitude: float | None = None,
    stiffness: float | None = None,
    noise: tuple[float, float] = (1e-3, 2e-2),
    counts: tuple[float, float] = (5e3, 5e4),
    colour: float = 0.0,
    form: str = "play",
) -> SpringRecord:
    """Return a record of a spring without damping; what is None is drawn.

    `noise` is the range of the noise of the force, relative to the range of the force. `counts` is
    the range of the number of counts of the encoder over the travel; its noise is half a count.
    `colour` is the correlation time of the noise of the force [s], 0 for white noise.
    """
    amplitude = amplitude or log_uniform(rng, 1e-3, 3e-3)
    stiffness = stiffness or log_uniform(rng, 2e3, 2e4)
    rig = transmission or drawn_transmission(rng, amplitude, stiffness, form)
    seconds = float(rng.uniform(4.0, 8.0))
    dt = 1.0 / (math.ceil(SPRING_RATE / rate) * rate)
    t = np.arange(round((seconds + BEFORE) / dt)) * dt - BEFORE
    x = amplitude * MOTIONS[motion].x(rng, t, seconds)
    if rig.form == "play":
        force = play(x, rig.lost_motion) / (1.0 / stiffness + rig.compliance)
    else:
        force = rig.slider.tip(x, dt, stiffness, 0.0)[1]
    sensor = sensed(rig, force, dt)
    n = np.arange(1, round(seconds * rate) - 1)
    times = n / rate
    step = 2.0 * amplitude / log_uniform(rng, *counts)
    spread = log_uniform(rng, *noise) * float(np.ptp(force))
    position = np.interp(times, t, x) + rng.normal(0.0, 0.5 * step, len(times))
    if colour:
        error = physics.coloured(rng, len(times), 1.0 / rate, colour, spread)
    else:
        error = rng.normal(0.0, spread, len(times))
    measured = np.interp(times, t, sensor) + error
    return SpringRecord(Log(times, physics.quantised(position, step), measured), stiffness, rig)


# Transmissions in front of tissue


def play(x: Array, half_width: float) -> Array:
    """Return the output of play, which starts in the middle.

    Between two reversals, the output is its value at the first, clipped to the input +-d.
    """
    rises = np.diff(x) > 0.0
    turns = np.flatnonzero(rises[1:] != rises[:-1]) + 1
    out = np.empty_like(x)
    y, first = float(x[0]), 0
    for last in [*turns.tolist(), len(x) - 1]:
        part = x[first : last + 1]
        out[first : last + 1] = np.clip(y, part - half_width, part + half_width)
        y, first = float(out[last]), last
    return out


def compressed(body: Viscous | Relaxing, z: Array, dt: float, c: float) -> tuple[Array, Array]:
    """Return depth y and force f of a body behind a compliance, of which y + c f is `z`."""
    if isinstance(body, Relaxing):
        t, y = np.arange(len(z)) * dt, z
        for _ in range(30):  # contracts, because the compliance is small
            y = z - c * body.force(t, y)
        return y, body.force(t, y)
    if isinstance(body, Linear) and z.min() > 0.0:
        series = 1.0 + c * body.k
        y = first_order(z / series, dt, c * body.b / series)
        force = (z - y) / c
        if force.min() > 0.0:
            return y, force
    return compressed_viscous(body, z, dt, c)


def compressed_viscous(body: Viscous, z: Array, dt: float, c: float) -> tuple[Array, Array]:
    """Return depth and force from implicit steps, linear about the depth of the step before."""
    lowest, highest = min(float(z.min()), 0.0), float(z.max())
    pitch = (highest - lowest) / TABLE
    grid = lowest + pitch * np.arange(TABLE + 2)
    elastic, viscosity = body.elastic(grid), body.viscosity(grid)
    if not body.bonded:
        elastic, viscosity = (np.where(grid > 0.0, law, 0.0) for law in (elastic, viscosity))
    slopes = (np.diff(elastic) / pitch).tolist()
    laws, dampings = elastic.tolist(), viscosity.tolist()
    y, depths, forces = lowest, [], []
    for n, position in enumerate(z.tolist()):
        if n == 0:
            y = position
        at = max(0.0, min((y - lowest) / pitch, TABLE))
        i = int(at)
        f, k = laws[i] + slopes[i] * (at - i) * pitch, slopes[i]
        b = dampings[i] + (dampings[i + 1] - dampings[i]) * (at - i)
        free = position - y
        step = (free - c * f) / (1.0 + c * (k + b / dt))
        force = (free - step) / c
        if force < 0.0 and not body.bonded:
            step, force = free, 0.0
        y += step
        depths.append(y)
        forces.append(force)
    return np.array(depths), np.array(forces)


def link(rig: Transmission) -> Link:
    """Return the transmission as a function of `independent.simulate`."""

    def apply(draw: Draw, x: Array, dt: float, body: Linear) -> tuple[Array, Array, Array]:
        c = rig.compliance
        if rig.form == "play":
            z = play(x, rig.lost_motion)
            depth, force = (
                compressed(body, z, dt, c) if c else (z, body.force(dt * np.arange(len(z)), z))
            )
            return depth, z, force
        depth, force = rig.slider.tip(x, dt, body.k, body.b)
        return depth, depth + c * force, force

    return apply
