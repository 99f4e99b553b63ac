"""Simulate records of palpation, for tests and benchmarks of estimation methods.

Each function in `COVERAGE_KINDS` and `WITHOUT_STIFFNESS` returns a record of one kind of palpation.
The body, the motion, the duration, the sampling rate and the noise are random. For the records of
`COVERAGE_KINDS`, the true stiffness is known. It is the slope df/dx of the elastic force at the
middle of the range of this force (k for a linear body), except in `relaxing_body`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from estimation.arrays import Floats


class TrueRecord(NamedTuple):
    """A simulated record of position and force, with the true parameters of the body."""

    t: Floats
    """Time [s], shape (n,)."""
    x: Floats
    """Position [m], shape (n,)."""
    f: Floats
    """Force [N], shape (n,)."""
    k: float
    """True stiffness [N/m], in most records df/dx at the middle of the force range; NaN if it is
    not defined."""
    b: float
    """True damping [N s/m]; NaN if it is not defined."""
    contact: float = math.nan
    """True position of the contact point [m]; NaN if the motion does not pass through it."""


def steps_of_time(rate: float, seconds: float) -> Floats:
    """Return the times of the samples [s], for a sampling rate [Hz] and a duration [s]."""
    return np.arange(round(rate * seconds)) / rate


def one_over_f(rng: Generator, n: int, rate: float, size: float, lowest: float = 0.0) -> Floats:
    """Return noise whose power spectrum is proportional to 1/frequency, shape (n,).

    n is the number of samples, `rate` is the sampling rate [Hz], and `size` is the standard
    deviation of the noise. The noise has no components at or below the frequency `lowest` [Hz].
    """
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    amplitude = np.zeros(len(frequency))
    part = frequency > lowest
    amplitude[part] = frequency[part] ** -0.5
    phases = rng.uniform(0.0, 2.0 * np.pi, len(frequency))
    noise = np.fft.irfft(amplitude * np.exp(1j * phases), n)
    return np.asarray(size * noise / np.std(noise))


def derivative(x: Floats, rate: float) -> Floats:
    """Return the time derivative [m/s] of a motion x [m] without noise, sampled at `rate` [Hz].

    A cubic spline is used. For a sine of 3 Hz, sampled at 100 Hz, central differences are 0.6 % too
    small. The resulting error of b would be larger than half the width of its confidence interval.
    """
    t = steps_of_time(rate, len(x) / rate)
    return np.asarray(CubicSpline(t, x)(t, 1))


def measured(rng: Generator, x: Floats, f: Floats, resolution: float) -> tuple[Floats, Floats]:
    """Simulate the sensors: return the measured position [m] and force [N].

    `x` [m] and `f` [N] are the true values. The measured position is rounded to `resolution` [m],
    one encoder count. The measured force contains noise.
    """
    size = float(np.ptp(f))
    noise = size * 10.0 ** rng.uniform(-3.0, -2.0)
    return np.round(x / resolution) * resolution, f + rng.normal(0.0, noise, len(f))


def smooth_ramps(t: Floats, times: Floats, levels: Floats, rounding: float) -> Floats:
    """Return a piecewise linear motion with rounded corners [m] at the n sample times t [s].

    `times` [s] and `levels` [m] are the times and positions of the corners. The corners are rounded
    by a Hann window of length `rounding` [s].
    """
    x = np.interp(t, times, levels)
    n = max(1, round(rounding / (t[1] - t[0])))
    window = np.hanning(n + 2)[1:-1]
    padded = np.concatenate([np.full(n, x[0]), x, np.full(n, x[-1])])
    return np.convolve(padded, window / window.sum(), mode="same")[n:-n]


def specimen(rng: Generator) -> tuple[float, float]:
    """Return a random stiffness k [N/m] and a random loss factor.

    The loss factor is b omega / k, where omega is the angular frequency of the motion.
    """
    return 10.0 ** rng.uniform(2.3, 4.3), rng.uniform(0.03, 0.3)


def sinusoid_with_drift(rng: Generator) -> TrueRecord:
    """Return a record of sinusoidal palpation around a mean force, with a drift of the position.

    The drift is slow. It changes the force by at most 10 % of k times the drift.
    """
    rate, seconds = rng.choice([100.0, 200.0, 1000.0]), rng.uniform(8.0, 40.0)
    frequency = rng.uniform(0.5, 3.0)
    k, loss = specimen(rng)
    omega = 2.0 * np.pi * frequency
    t = steps_of_time(rate, seconds)
    amplitude = 10.0 ** rng.uniform(-4.0, -2.7)
    palpation = amplitude * np.sin(omega * t + rng.uniform(0.0, 6.0))
    slow = 2.0 * np.pi * rng.uniform(0.02, 0.06)
    drift = amplitude * rng.uniform(0.5, 8.0) * np.sin(slow * t + rng.uniform(0.0, 6.0))
    b = k * loss / omega
    f = k * amplitude * rng.uniform(1.2, 3.0) + k * palpation + b * derivative(palpation, rate)
    f += k * rng.uniform(0.0, 0.1) * drift
    x, f = measured(rng, 5e-3 + palpation + drift, f, amplitude * 1e-3)
    return TrueRecord(t, x, f, k, b)


def stiffening_force(x: Floats, k: float, k3: float) -> Floats:
    """Return the elastic force [N] of a stiffening body: k x + k3 x^3 for x > 0, otherwise 0."""
    depth = np.maximum(x, 0.0)
    return k * depth + k3 * depth**3


def mid_tangent(k: float, k3: float, lowest: float, highest: float) -> float:
    """Return the slope df/dx [N/m] of `stiffening_force` at the middle of a range of forces.

    The range is from the force at the position `lowest` [m] to the force at the position `highest`
    [m].
    """
    grid = np.linspace(lowest, highest, 20001)
    f = stiffening_force(grid, k, k3)
    x = float(np.interp(0.5 * (f[0] + f[-1]), f, grid))
    return k + 3.0 * k3 * x * x


def ramp_hold_release(rng: Generator) -> TrueRecord:
    """Return a record of a ramp into a stiffening body, a hold, and a ramp out of the body."""
    rate = rng.choice([100.0, 500.0, 1000.0])
    depth = 10.0 ** rng.uniform(-3.0, -2.0)
    k, loss = specimen(rng)
    k3 = k * rng.uniform(0.2, 1.0) / depth**2
    gap = depth * rng.uniform(0.05, 0.4)
    ramp, hold = rng.uniform(1.0, 5.0), rng.uniform(2.0, 15.0)
    times = np.cumsum([0.0, 1.0, ramp, hold, ramp * rng.uniform(0.5, 2.0), 1.0])
    t = steps_of_time(rate, times[-1])
    levels = np.array([-gap, -gap, depth, depth, -gap, -gap])
    x = smooth_ramps(t, times, levels, 0.1 * ramp)
    b = k * loss * 0.3 * ramp / (2.0 * np.pi)
    f = stiffening_force(x, k, k3) + b * derivative(x, rate) * (x > 0.0)
    f = np.maximum(f, 0.0)
    offset, zero = rng.uniform(-0.05, 0.05) * np.ptp(f), rng.uniform(-0.1, 0.1)
    measured_x, f = measured(rng, x + zero, f + offset, depth * 5e-4)
    return TrueRecord(t, measured_x, f, mid_tangent(k, k3, 0.0, depth), b, zero)


def intermittent_contact(rng: Generator) -> TrueRecord:
    """Return a record of a linear or stiffening body, with loss of contact in every cycle."""
    rate, seconds = rng.choice([200.0, 500.0, 1000.0]), rng.uniform(6.0, 30.0)
    frequency = rng.uniform(0.4, 2.0)
    depth = 10.0 ** rng.uniform(-3.0, -2.0)
    k, loss = specimen(rng)
    k3 = rng.choice([0.0, k * rng.uniform(0.2, 0.8) / depth**2])
    t = steps_of_time(rate, seconds)
    omega = 2.0 * np.pi * frequency
    amplitude = depth / (1.0 + rng.uniform(-0.5, 0.3))
    wander = 0.03 * amplitude * np.sin(2.0 * np.pi * rng.uniform(0.05, 0.2) * t)
    x = depth - amplitude + wander - amplitude * np.cos(omega * t)
    b = k * loss / omega
    f = stiffening_force(x, k, k3) + b * derivative(x, rate) * (x > 0.0)
    f = np.maximum(f, 0.0)
    offset, zero = rng.uniform(-0.05, 0.05) * np.ptp(f), rng.uniform(-0.1, 0.1)
    measured_x, f = measured(rng, x + zero, f + offset, depth * 1e-3)
    return TrueRecord(t, measured_x, f, mid_tangent(k, k3, 0.0, float(x.max())), b, zero)


def sliding_palpation(rng: Generator) -> TrueRecord:
    """Return a record of palpation while the probe slides over the body.

    Friction adds noise to the force. Its power spectrum is proportional to 1/frequency.
    """
    rate, seconds = rng.choice([100.0, 200.0, 500.0]), rng.uniform(10.0, 40.0)
    frequency = rng.uniform(0.5, 3.0)
    k, loss = specimen(rng)
    omega = 2.0 * np.pi * frequency
    t = steps_of_time(rate, seconds)
    amplitude = 10.0 ** rng.uniform(-3.5, -2.5)
    phase = omega * t + np.cumsum(rng.normal(0.0, 0.3 / math.sqrt(rate), len(t)))
    x = amplitude * np.sin(phase)
    n = max(3, round(0.05 * rate / frequency))
    x = np.convolve(np.pad(x, n, mode="reflect"), np.ones(n) / n, mode="same")[n:-n]
    b = k * loss / omega
    f = k * (x + 3.0 * amplitude) + b * derivative(x, rate)
    f += one_over_f(rng, len(t), rate, k * amplitude * rng.uniform(0.1, 0.8))
    measured_x, f = measured(rng, x + 3e-3, f, amplitude * 1e-3)
    return TrueRecord(t, measured_x, f, k, b)


def relaxed(x: Floats, rate: float, time: float) -> Floats:
    """Return the solution z [m] of dz/dt = dx/dt - z / time with z = 0 at the start, shape (n,).

    z is the elongation of the spring in a Maxwell element (spring and damper in series) with the
    displacement x. The solution is exact if x changes linearly between the samples. `rate` is the
    sampling rate [Hz], and `time` is the time constant of the relaxation [s].
    """
    decay = math.exp(-1.0 / (rate * time))
    gain = time * rate * (1.0 - decay)
    return np.asarray(lfilter([gain, -gain], [1.0, -decay], x - x[0]))


def relaxing_body(rng: Generator) -> TrueRecord:
    """Return a record of palpation of a standard linear solid, whose force relaxes in a hold.

    The motion is one ramp and hold, three ramps with holds, or a sine. For ramps, the true
    stiffness is df/dx at the time when the force first reaches half of its maximum during a ramp.
    For a sine, the true stiffness is the storage stiffness (real part of the complex stiffness).
    """
    rate = rng.choice([100.0, 500.0])
    depth = 10.0 ** rng.uniform(-3.3, -2.3)
    k, _ = specimen(rng)
    k1, tau = k * rng.uniform(0.2, 1.0), 10.0 ** rng.uniform(-0.3, 1.3)
    kind = rng.choice(["ramp", "steps", "sine"])
    if kind == "sine":
        frequency, seconds = rng.uniform(0.3, 2.0), rng.uniform(10.0, 30.0)
        t = steps_of_time(rate, seconds)
        s = 2.0 * np.pi * frequency
        lead = steps_of_time(rate, 20.0 * tau)
        x_long = depth * (1.0 + 0.5 * np.sin(s * np.concatenate([lead - lead[-1] - 1 / rate, t])))
        f = k * x_long + k1 * relaxed(x_long, rate, tau)
        x, f = x_long[len(lead) :], f[len(lead) :]
        wt = s * tau
        truth = k + k1 * wt**2 / (1.0 + wt**2)
    else:
        ramp, hold = rng.uniform(0.5, 3.0), rng.uniform(5.0, 40.0)
        count = 1 if kind == "ramp" else 3
        times = [0.0, 0.5]
        levels = [0.0, 0.0]
        for i in range(count):
            times += [times[-1] + ramp, times[-1] + ramp + hold]
            levels += [depth * (i + 1) / count] * 2
        t = steps_of_time(rate, times[-1])
        x = smooth_ramps(t, np.array(times), np.array(levels), 0.1 * ramp)
        f = k * x + k1 * relaxed(x, rate, tau)
        crossed = (f >= 0.5 * f.max()) & (derivative(x, rate) > 0.0)
        i = int(np.flatnonzero(crossed)[0])
        f_of, x_of = CubicSpline(t, f), CubicSpline(t, x)
        middle = t[i - 1] + (0.5 * f.max() - f[i - 1]) / (f[i] - f[i - 1]) / rate
        truth = float(f_of(middle, 1) / x_of(middle, 1))
    measured_x, f = measured(rng, x, f, depth * 5e-4)
    return TrueRecord(t, measured_x, f, truth, math.nan)


def free_motion(rng: Generator) -> TrueRecord:
    """Return a record of motion without contact. The force is noise with an offset and a drift."""
    rate, seconds = rng.choice([100.0, 1000.0]), rng.uniform(3.0, 20.0)
    t = steps_of_time(rate, seconds)
    x = 5e-3 * np.sin(2.0 * np.pi * rng.uniform(0.3, 3.0) * t)
    noise = 10.0 ** rng.uniform(-3.0, -1.0)
    f = rng.normal(0.0, noise, len(t)) + noise * rng.uniform(0.0, 3.0) * t / seconds
    return TrueRecord(t, x, f + rng.uniform(-1.0, 1.0), math.nan, math.nan)


def rigid_stop(rng: Generator) -> TrueRecord:
    """Return a record of motion against a rigid wall. In contact, the true position is constant."""
    rate, seconds = rng.choice([500.0, 2000.0]), rng.uniform(5.0, 15.0)
    t = steps_of_time(rate, seconds)
    frequency = rng.uniform(0.5, 2.0)
    wanted = 5e-3 * np.sin(2.0 * np.pi * frequency * t) + 1e-3
    x = np.minimum(wanted, 0.0)
    f = 2000.0 * np.maximum(wanted, 0.0) * rng.uniform(0.5, 2.0)
    x = np.round((x + rng.normal(0.0, 2e-6, len(t))) / 5e-6) * 5e-6
    return TrueRecord(t, x, f + rng.normal(0.0, 0.02, len(t)), math.nan, math.nan, 0.0)


def clipped_sensor(rng: Generator) -> TrueRecord:
    """Return a record of sinusoidal palpation with a force cut off at the range of the sensor."""
    record = sinusoid_with_drift(rng)
    level = float(np.percentile(record.f, rng.uniform(70.0, 92.0)))
    return record._replace(f=np.minimum(record.f, level), k=math.nan, b=math.nan)


COVERAGE_KINDS: dict[str, Callable[[Generator], TrueRecord]] = {
    "sinusoid with drift": sinusoid_with_drift,
    "ramp, hold, release": ramp_hold_release,
    "intermittent contact": intermittent_contact,
    "sliding palpation": sliding_palpation,
    "relaxing body": relaxing_body,
}
"""Functions that return a record with a known true stiffness, by the kind of palpation."""
WITHOUT_STIFFNESS: dict[str, Callable[[Generator], TrueRecord]] = {
    "free motion": free_motion,
    "rigid stop": rigid_stop,
    "clipped sensor": clipped_sensor,
}
"""Functions that return a record whose stiffness cannot be estimated, by the kind of palpation."""
