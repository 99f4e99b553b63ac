"""Physics of `independent.py`: bodies, motions, transmissions and loggers of its own.

This module imports nothing of the package. The bodies are simulated at 20 kHz or more. All
quantities are in SI units. Depths are relative to the surface of the body; a force is positive in
compression.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from scipy.signal import butter, fftconvolve, lfilter, sosfilt

Array = np.ndarray
Function = Callable[[Array], Array]


# Bodies


@dataclass(frozen=True)
class Viscous:
    """f = P(d) + B(d) v: a body without memory. A tip that is not bonded cannot pull."""

    elastic: Function
    tangent: Function
    viscosity: Function
    bonded: bool = False

    def force(self, t: Array, d: Array) -> Array:
        v = np.gradient(d, t)
        f = self.elastic(d) + self.viscosity(d) * v
        return f if self.bonded else np.where(d > 0.0, np.maximum(f, 0.0), 0.0)


@dataclass(frozen=True)
class Linear(Viscous):
    """Kelvin-Voigt body."""

    k: float = 0.0
    b: float = 0.0


def kelvin_voigt(k: float, b: float, bonded: bool = False) -> Linear:
    return Linear(lambda d: k * d, lambda d: k + 0.0 * d, lambda d: b + 0.0 * d, bonded, k, b)


def fung(k: float, steepness: float, b: float) -> Viscous:
    """Return a body whose stiffness grows as k exp(steepness d)."""
    return Viscous(
        lambda d: k / steepness * np.expm1(steepness * np.maximum(d, 0.0)),
        lambda d: k * np.exp(steepness * np.maximum(d, 0.0)),
        lambda d: b + 0.0 * d,
    )


def power_law(coefficient: float, n: float, b: float) -> Viscous:
    return Viscous(
        lambda d: coefficient * np.maximum(d, 0.0) ** n,
        lambda d: n * coefficient * np.maximum(d, 0.0) ** (n - 1.0),
        lambda d: b + 0.0 * d,
    )


def hunt_crossley(coefficient: float, n: float, alpha: float) -> Viscous:
    """Return a body with f = K d^n (1 + alpha v)."""
    law = power_law(coefficient, n, 0.0)
    return Viscous(law.elastic, law.tangent, lambda d: alpha * law.elastic(d))


def layered(soft: float, stiff: float, knee: float, width: float, b: float) -> Viscous:
    """Return a soft layer on a stiff one; the knee has a `width`, 0 for a sharp knee."""
    if width == 0.0:
        return Viscous(
            lambda d: soft * d + (stiff - soft) * np.maximum(d - knee, 0.0),
            lambda d: np.where(d > knee, stiff, soft),
            lambda d: b + 0.0 * d,
        )
    start = width * np.logaddexp(0.0, -knee / width)
    return Viscous(
        lambda d: (
            soft * d + (stiff - soft) * (width * np.logaddexp(0.0, (d - knee) / width) - start)
        ),
        lambda d: soft + (stiff - soft) / (1.0 + np.exp(-(d - knee) / width)),
        lambda d: b + 0.0 * d,
    )


@dataclass(frozen=True)
class Relaxing:
    """Quasi-linear viscoelastic body: a law of depth, and Maxwell arms (share, time constant)."""

    law: Function
    arms: Sequence[tuple[float, float]]
    bonded: bool = False

    def force(self, t: Array, d: Array) -> Array:
        dt = t[1] - t[0]
        elastic = self.law(d)
        change = np.diff(elastic, prepend=0.0)
        f = elastic.copy()
        for share, tau in self.arms:
            decay = math.exp(-dt / tau)
            # Exact if the elastic force is linear in time between the samples.
            f += share * tau / dt * lfilter([1.0 - decay], [1.0, -decay], change)
        return f if self.bonded else np.where(d > 0.0, np.maximum(f, 0.0), 0.0)

    def complex_stiffness(self, omega: float) -> complex:
        """Return the complex stiffness in a steady sine; the law must be linear."""
        k = float(self.law(np.ones(1))[0])
        return k * (1.0 + sum(s * 1j * omega * t / (1.0 + 1j * omega * t) for s, t in self.arms))


def poroelastic(k: float, tau: float, terms: int = 30) -> Relaxing:
    """Return a layer that consolidates (Terzaghi): its arms are those of sqrt(s tau) coth."""
    arms = [(2.0, tau / (n * math.pi) ** 2) for n in range(1, terms + 1)]
    return Relaxing(lambda d: k * np.maximum(d, 0.0), arms)


@dataclass(frozen=True)
class Springpot:
    """f = K d^alpha/dt^alpha of the depth, parallel to a spring (Gruenwald-Letnikov)."""

    coefficient: float
    alpha: float
    spring: float

    def force(self, t: Array, d: Array) -> Array:
        dt = t[1] - t[0]
        n = np.arange(1, len(t))
        weights = np.concatenate([[1.0], np.cumprod(1.0 - (self.alpha + 1.0) / n)])
        fractional = fftconvolve(d, weights)[: len(t)] * dt**-self.alpha
        return self.spring * d + self.coefficient * fractional

    def complex_stiffness(self, omega: float) -> complex:
        """Return the complex stiffness in a steady sine."""
        return self.spring + self.coefficient * complex(0.0, omega) ** self.alpha


@dataclass(frozen=True)
class WithFriction:
    """A body with friction inside it (Dahl): the friction grows over the distance `slip`."""

    body: Viscous
    friction: float
    slip: float

    def force(self, t: Array, d: Array) -> Array:
        f = self.body.force(t, d)
        if self.body.bonded:
            return f + self.friction * dahl(d, self.slip)
        friction = self.friction * dahl(np.maximum(d, 0.0), self.slip)
        return np.where(d > 0.0, np.maximum(f + friction, 0.0), 0.0)


def dahl(d: Array, slip: float) -> Array:
    """Return the friction of Dahl relative to its limit; exact for each step of the depth."""
    z = 0.0
    states = [0.0]
    for step in np.diff(d).tolist():
        side = 1.0 if step > 0.0 else -1.0
        z = side + (z - side) * math.exp(-abs(step) / slip)
        states.append(z)
    return np.array(states)


@dataclass(frozen=True)
class Adhesive:
    """A Kelvin-Voigt body that holds the tip until the force is below -`pull`."""

    k: float
    b: float
    pull: float

    def force(self, t: Array, d: Array) -> Array:
        f = self.k * d + self.b * np.gradient(d, t)
        attached = np.zeros(len(t), bool)
        now = False
        for i, (depth, force) in enumerate(zip(d.tolist(), f.tolist(), strict=True)):
            now = depth > 0.0 or (now and force > -self.pull)
            attached[i] = now
        return np.where(attached, f, 0.0)


@dataclass(frozen=True)
class Changing:
    """A Kelvin-Voigt body whose stiffness is multiplied by a function of time."""

    k: float
    b: float
    factor: Function

    def force(self, t: Array, d: Array) -> Array:
        scale = self.factor(t)
        f = scale * (self.k * d + self.b * np.gradient(d, t))
        return np.where(d > 0.0, np.maximum(f, 0.0), 0.0)


@dataclass(frozen=True)
class Punctured:
    """A Kelvin-Voigt body whose force falls to `rest` of its value when a depth is first passed."""

    k: float
    b: float
    depth: float
    rest: float

    def force(self, t: Array, d: Array) -> Array:
        f = kelvin_voigt(self.k, self.b).force(t, d)
        after = np.maximum.accumulate(d) > self.depth
        return np.where(after, self.rest * f, f)


# Motions: depth of the encoder over time


def sine(t: Array, frequency: float, amplitude: float, centre: float, phase: float = 0.0) -> Array:
    return centre + amplitude * np.sin(2.0 * math.pi * frequency * t + phase)


def multi_sine(t: Array, frequencies: Sequence[float], phases: Sequence[float]) -> Array:
    """Return a sum of sines of equal peak velocity, with a largest absolute value of 1."""
    x = sum(np.sin(2.0 * math.pi * f * t + p) / f for f, p in zip(frequencies, phases, strict=True))
    return np.asarray(x / np.abs(x).max())


def triangle(t: Array, frequency: float) -> Array:
    """Return a triangle wave between -1 and 1 whose corners are rounded over 4 % of a period."""
    x = 2.0 / math.pi * np.arcsin(0.998 * np.sin(2.0 * math.pi * frequency * t))
    return np.asarray(x / np.abs(x).max())


def hand(rng: Generator, t: Array, low: float, high: float) -> Array:
    """Return band-limited random motion with a largest absolute value of 1."""
    count = 40
    frequencies = rng.uniform(low, high, count)
    weights = rng.normal(size=count) / frequencies
    phases = rng.uniform(0.0, 2.0 * math.pi, count)
    x = sum(
        w * np.sin(2.0 * math.pi * f * t + p)
        for w, f, p in zip(weights, frequencies, phases, strict=True)
    )
    return np.asarray(x / np.abs(x).max())


def presses(
    rng: Generator, t: Array, each: float, depth: float, lift: float, least: float = 0.8
) -> Array:
    """Return presses of duration `each`, from `lift` above the surface.

    Their depth is at least the share `least` of `depth`.
    """
    times, depths = [t[0] - each], [-lift]
    while times[-1] < t[-1] + each:
        pause, length = each * rng.uniform(0.1, 0.3), each * rng.uniform(0.7, 1.1)
        times += [times[-1] + pause, times[-1] + pause + 0.5 * length, times[-1] + pause + length]
        depths += [-lift, depth * rng.uniform(least, 1.0), -lift]
    return np.asarray(minimum_jerk(t, times, depths))


def ramps_and_holds(t: Array, ramp: float, hold: float, low: float, high: float) -> Array:
    """Return ramps from `low` to `high` and back, with holds at both ends."""
    period = 2.0 * (ramp + hold)
    s = np.mod(t, period)
    up = np.clip(s / ramp, 0.0, 1.0) - np.clip((s - ramp - hold) / ramp, 0.0, 1.0)
    return low + (high - low) * up


def minimum_jerk(t: Array, times: Sequence[float], values: Sequence[float]) -> Array:
    """Return a motion that rests at the given values at the given times."""
    n = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    start, end = np.asarray(times)[n], np.asarray(times)[n + 1]
    s = np.clip((t - start) / (end - start), 0.0, 1.0)
    first, second = np.asarray(values)[n], np.asarray(values)[n + 1]
    return np.asarray(first + (second - first) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


# Transmissions: from the encoder to the tip of a Kelvin-Voigt body


def gap(x: Array, dt: float, k: float, b: float, width: float) -> tuple[Array, Array]:
    """Return tip and force of a bonded body behind a gap of +-`width`.

    The tip has neither inertia nor friction: in the gap, the body moves it to zero force.
    """
    y, tips, forces = 0.0, [], []
    decay = b / (b + dt * k)
    for position in x.tolist():
        before = y
        y = min(max(y * decay, position - width), position + width)
        tips.append(y)
        forces.append(k * y + b * (y - before) / dt)
    return np.array(tips), np.array(forces)


@dataclass(frozen=True)
class Slider:
    """Friction on the slider that carries the tip, which a spring of `compliance` moves."""

    form: str
    """`coulomb`, `dahl`, `lugre` or `bouc-wen`."""
    friction: float
    compliance: float
    slip: float = 1e-6
    static: float = 1.3
    """Static friction relative to the friction in motion, for `lugre`."""

    def tip(self, x: Array, dt: float, k: float, b: float) -> tuple[Array, Array]:
        """Return the position of the tip and its force, from implicit Euler steps.

        The force in the spring, (x - y) / compliance, is the sum of the force of the body and the
        friction.
        """
        stiffness = 1.0 / self.compliance
        sigma = self.friction / self.slip
        sigma1 = 2.0 * math.sqrt(sigma) * 0.1 if self.form == "lugre" else 0.0
        smooth = b + dt * (k + stiffness)
        y, z, v = x[0] * stiffness / (stiffness + k), 0.0, 0.0
        tips, forces = [], []
        for position in x.tolist():
            drive = (position - y) * stiffness - k * y
            net = drive - sigma * z
            # The state relative to its limit; positive if the motion makes it grow.
            grows = math.copysign(1.0, net) * z / self.slip
            if self.form == "coulomb":
                v = max(drive - self.friction, 0.0) + min(drive + self.friction, 0.0)
                v /= smooth
            elif self.form == "lugre":
                limit = self.slip * (1.0 + (self.static - 1.0) * math.exp(-((v / 1e-3) ** 2)))
                free = max(1.0 - grows * self.slip / limit, 0.0)
                v = net / (smooth + (sigma1 + dt * sigma) * free)
                z = (z + v * dt) / (1.0 + dt * abs(v) / limit)
            elif self.form == "dahl":
                v = net / (smooth + dt * sigma * max(1.0 - grows, 0.0))
                side = math.copysign(self.slip, v)
                z = side + (z - side) * math.exp(-abs(v) * dt / self.slip)
            else:  # Bouc-Wen, exponent 2, equal shares of beta and gamma
                free = max(1.0 - grows**2, 0.0) if grows > 0.0 else 1.0
                v = net / (smooth + dt * sigma * free)
                z += v * dt * free
            y += v * dt
            tips.append(y)
            forces.append(k * y + b * v)
        return np.array(tips), np.array(forces)


# Sensors and loggers


def first_order(f: Array, dt: float, tau: float) -> Array:
    share = 1.0 - math.exp(-dt / tau)
    out = lfilter([share], [1.0, share - 1.0], f - f[0])
    return np.asarray(out) + f[0]


def delayed(f: Array, dt: float, delay: float) -> Array:
    n = round(delay / dt)
    return np.concatenate([np.full(n, f[0]), f[: len(f) - n]])


def low_pass(f: Array, dt: float, cutoff: float) -> Array:
    sections = butter(2, cutoff, fs=1.0 / dt, output="sos")
    return np.asarray(sosfilt(sections, f - f[0])) + f[0]


def coloured(rng: Generator, n: int, period: float, tau: float, std: float) -> Array:
    """Return AR(1) noise with a correlation time `tau`."""
    decay = math.exp(-period / tau)
    white = rng.normal(0.0, std * math.sqrt(1.0 - decay**2), n)
    white[0] = rng.normal(0.0, std)
    return np.asarray(lfilter([1.0], [1.0, -decay], white))


def quantised(x: Array, step: float) -> Array:
    return np.round(x / step) * step


# The truth of a record without noise


@dataclass(frozen=True)
class Physics:
    """What happened, without noise, at a high rate."""

    t: Array
    x: Array
    """Position of the encoder."""
    tip: Array
    """Position of the encoder without lost motion: depth of the tip plus compliance times force."""
    body: Array
    """Force of the body."""
    sensor: Array
    """Force at the sensor, with masses, before its lag."""
    depth: Array = field(default_factory=lambda: np.zeros(0))
    """Depth of the tip below the surface."""


def complex_stiffness(t: Array, x: Array, f: Array, frequency: float) -> complex:
    """Return F1 / X1 at a frequency, over whole periods, with a quadratic baseline."""
    whole = math.floor((t[-1] - t[0]) * frequency + 1e-6) / frequency
    use = t < t[0] + whole - 0.5 * (t[1] - t[0])
    s = (t[use] - t[0]) / whole - 0.5
    angle = 2.0 * math.pi * frequency * t[use]
    columns = np.column_stack([np.cos(angle), -np.sin(angle), np.ones_like(s), s, s**2])
    parts = np.linalg.lstsq(columns, np.column_stack([x[use], f[use]]), rcond=None)[0]
    first = parts[0] + 1j * parts[1]
    return complex(first[1] / first[0])


def loading_slope(x: Array, f: Array, at: float, band: float = 0.05) -> float | None:
    """Return the slope of the force while it is loaded near a force; None if it was not passed.

    The slopes of all passes near the force are pooled; each pass has its own level.
    """
    width = band * np.ptp(f)
    use = (np.gradient(x) > 0.0) & (np.abs(f - at) < width)
    edges = np.flatnonzero(np.diff(use.astype(int)))
    passes = np.split(np.arange(len(x)), edges + 1)
    above = below = 0.0
    for part in passes:
        if len(part) > 2 and use[part[0]]:
            dx = x[part] - x[part].mean()
            above += float(dx @ (f[part] - f[part].mean()))
            below += float(dx @ dx)
    return above / below if below > 0.0 else None
