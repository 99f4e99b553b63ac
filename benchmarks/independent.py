"""Check `teleop estimate` on records of other physics: `python benchmarks/independent.py`.

The records are simulated by `independent_bodies.py`, which shares no code with the package. The
cases are drawn at random from the kinds in `KINDS`. The physics without noise gives the truth for
the force and the frequency that the result states. For k this can be more than one number, each
of which is right:

- the slope of the force against the position in loading, near the stated force (for a steady sine
  without the equivalent viscous force, so that it is the storage stiffness of a linear body);
- the slope of the elastic force, for bodies that have one, at the depth of this point of the
  record, and at the depth at which the elastic force is the stated force.

b is k''/omega at the stated frequency, or else the derivative of the force to the velocity at the
stated force, for bodies that have one. Both refer to the tip and the compliance in series, without
lost motion and lag. k and b are judged separately:

- right: the 95 % interval contains the truth, or the error is below 1 % (b: below 0.02 k/omega);
- near: outside the interval, but the error is below 10 %;
- named: wrong or withheld, and a reason or remark names the cause that was put into the record;
- WRONG: none of these, or a number where none exists;
- refused: withheld without need, and the cause is not named;
- unnamed: rightly withheld, but with another cause as the reason.

A false alarm is a remark on a record without a fault that states no true fact of the case. A remark
on another cause counts neither as `named` nor as allowed. Seed 1 is for development. An acceptance
run uses a seed that was never used before.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import json
import math
import re
import tempfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import independent_bodies as physics
import numpy as np
from independent_bodies import Array, Linear, Physics, Relaxing, Springpot, Viscous, WithFriction

from teleop.cli import main as teleop

SIMULATED_RATE = 20_000.0
"""Lowest rate of the simulation [Hz]."""
TRUTH_RATE = 2_000.0
"""Rate at which the truth is computed [Hz]."""
CLOSE, NEAR = 0.01, 0.1
CLOSE_LOSS = 0.02
"""Error of b, relative to k/omega, that counts as right: an error of tan delta."""
MOST_ROWS = 15_000

RANGES = {
    "k": (100.0, 60_000.0),
    "frequency": (0.2, 4.0),
    "amplitude": (3e-4, 5e-3),
    "noise": (1e-3, 2e-2),
    "rate": (100.0, 2000.0),
    "loss": (0.02, 0.3),
    "seconds": (8.0, 30.0),
}


class Draw:
    """The random values of a case; kinds can narrow their ranges."""

    def __init__(self, rng: np.random.Generator, **ranges: tuple[float, float]) -> None:
        self.rng = rng
        values = {name: self.log(*(ranges.get(name) or limits)) for name, limits in RANGES.items()}
        self.k, self.frequency, self.amplitude = (
            values[name] for name in ("k", "frequency", "amplitude")
        )
        self.noise, self.loss = values["noise"], values["loss"]
        self.seconds = max(values["seconds"], 6.0 / self.frequency)
        self.rate = float(round(max(values["rate"], 40.0 * self.frequency)))
        self.rate = min(self.rate, float(round(MOST_ROWS / self.seconds)))
        self.centre = self.amplitude * self.uniform(1.3, 1.8)
        """Mean depth of a motion in contact throughout; bodies that relax need more."""
        self.origin = self.uniform(0.0, 0.01)
        """Position of the surface in the file."""
        self.resolution = 2.0 * self.amplitude * self.log(1.0 / 50_000.0, 1.0 / 5_000.0)
        """Resolution of the position sensor; its noise is half of that."""
        self.options: list[str] = []
        self.notes: dict[str, float] = {}

    def uniform(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(math.log(low), math.log(high))))

    @property
    def omega(self) -> float:
        return 2.0 * math.pi * self.frequency

    @property
    def b(self) -> float:
        """Viscosity for the drawn loss at the frequency of the motion."""
        return self.loss * self.k / self.omega


class Log(NamedTuple):
    """The record of a logger."""

    t: Array
    x: Array
    f: Array


Made = Any
Motion = Callable[[Draw, Array], Array]
Link = Callable[[Draw, Array, float, Linear], tuple[Array, Array, Array]]
"""Returns depth of the tip, depth of tip with the compliance in series, and force of the body."""
Analog = Callable[[Draw, Array, Array, Array], tuple[Array, Array]]
"""Changes position and force before they are sampled."""
Logged = Callable[[Draw, Log], Log]


@dataclass(frozen=True)
class Kind:
    name: str
    body: Callable[[Draw], Made]
    motion: Motion
    steady: bool = False
    """Whether the motion is a sine."""
    link: Link | None = None
    analog: tuple[Analog, ...] = ()
    logged: tuple[Logged, ...] = ()
    prepare: Callable[[Draw], None] | None = None
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    mass: bool = False
    white: bool = True
    """Whether white noise is added to the force."""
    jitter: float = 0.0
    """Standard deviation of the sampling times relative to the period; the file has the times."""
    cause: str = ""
    """What one of the reasons or remarks must match to name the cause; empty without a fault."""
    allowed: str = ""
    """Remarks that state a true fact of a case without a fault."""
    has_k: bool = True
    """Whether a single stiffness exists."""


ALWAYS_ALLOWED = r"damping is not resolved|^few samples"


# Bodies, drawn


def linear(draw: Draw) -> Linear:
    return physics.kelvin_voigt(draw.k, draw.b)


def bonded(draw: Draw) -> Linear:
    return physics.kelvin_voigt(draw.k, draw.b, bonded=True)


def stiffening(draw: Draw) -> Viscous:
    """Return a Fung body whose stiffness grows by a factor of 2 to 6 over the motion."""
    steepness = math.log(draw.uniform(2.0, 6.0)) / (2.0 * draw.amplitude)
    return physics.fung(draw.k, steepness, draw.b)


def power(draw: Draw) -> Viscous:
    n = draw.uniform(1.3, 2.2)
    return physics.power_law(draw.k / draw.amplitude ** (n - 1.0), n, draw.b)


def sphere(draw: Draw) -> Viscous:
    """Return the contact of a sphere (Hertz): 4/3 E* sqrt(R) d^1.5."""
    radius = draw.uniform(2e-3, 8e-3)
    modulus = draw.k / (2.0 * math.sqrt(radius * draw.amplitude))
    return physics.power_law(4.0 / 3.0 * modulus * math.sqrt(radius), 1.5, 0.3 * draw.b)


def depth_damped(n: float | None, low: float, high: float) -> Callable[[Draw], Viscous]:
    """Return a Hunt-Crossley body whose damping at the highest speed is a share of the force."""

    def make(draw: Draw) -> Viscous:
        exponent = n or draw.uniform(1.2, 1.8)
        alpha = draw.uniform(low, high) / (draw.omega * draw.amplitude)
        coefficient = draw.k / draw.amplitude ** (exponent - 1.0)
        return physics.hunt_crossley(coefficient, exponent, alpha)

    return make


def layers(ratio: tuple[float, float], width: float, knee: tuple[float, float]) -> Made:
    """Return a soft layer on a stiff one; the knee is a share of the travel in contact."""

    def make(draw: Draw) -> Viscous:
        stiff = draw.k * draw.uniform(*ratio)
        depth = 2.0 * draw.amplitude * draw.uniform(*knee)
        return physics.layered(draw.k, stiff, depth, width * draw.amplitude, draw.b)

    return make


def arms_of(draw: Draw) -> list[tuple[float, float]]:
    count = int(draw.rng.integers(2, 4))
    return [(draw.uniform(0.1, 0.4), draw.log(0.03, 3.0)) for _ in range(count)]


def solid(draw: Draw) -> Relaxing:
    """Return a generalised standard linear solid."""
    draw.centre = draw.amplitude * draw.uniform(2.5, 3.5)
    return Relaxing(lambda d: draw.k * np.maximum(d, 0.0), arms_of(draw))


def quasi_linear(draw: Draw) -> Relaxing:
    draw.centre = draw.amplitude * draw.uniform(1.8, 2.2)
    steepness = math.log(draw.uniform(1.5, 3.0)) / (2.0 * draw.amplitude)
    return Relaxing(physics.fung(draw.k, steepness, 0.0).elastic, arms_of(draw))


def consolidating(draw: Draw) -> Relaxing:
    draw.centre = draw.amplitude * draw.uniform(3.0, 4.0)
    return physics.poroelastic(draw.k, draw.log(0.5, 10.0) / draw.omega)


def springpot(draw: Draw) -> Springpot:
    draw.centre = draw.amplitude * draw.uniform(2.5, 3.5)
    alpha = draw.uniform(0.08, 0.3)
    return Springpot(draw.k / draw.omega**alpha, alpha, draw.k * draw.uniform(0.3, 1.0))


def with_friction(slip: float) -> Callable[[Draw], WithFriction]:
    """Return a body with friction inside it; `slip` is relative to the amplitude."""

    def make(draw: Draw) -> WithFriction:
        friction = draw.uniform(0.03, 0.12) * draw.k * draw.amplitude
        return WithFriction(bonded(draw), friction, slip * draw.amplitude)

    return make


def adhesive(draw: Draw) -> physics.Adhesive:
    pull = draw.uniform(0.05, 0.2) * draw.k * draw.amplitude
    return physics.Adhesive(draw.k, 0.2 * draw.b, pull)


def step_that_returns(draw: Draw) -> physics.Changing:
    begin, end = draw.uniform(0.3, 0.4) * draw.seconds, draw.uniform(0.6, 0.7) * draw.seconds
    change = draw.uniform(0.3, 0.8) * draw.rng.choice([1.0, -0.7])
    return physics.Changing(
        draw.k, draw.b, lambda t: np.where((t > begin) & (t < end), 1.0 + change, 1.0)
    )


def softening(draw: Draw) -> physics.Changing:
    """Return a body that loses 25 to 50 % of its stiffness, most of it at first (Mullins)."""
    loss, tau = draw.uniform(0.25, 0.5), draw.seconds * draw.uniform(0.2, 0.4)
    return physics.Changing(
        draw.k, draw.b, lambda t: 1.0 - loss * (1.0 - np.exp(-np.maximum(t, 0.0) / tau))
    )


def heating(draw: Draw) -> physics.Changing:
    loss = draw.uniform(0.2, 0.4)
    return physics.Changing(
        draw.k, draw.b, lambda t: 1.0 - loss * np.maximum(t, 0.0) / draw.seconds
    )


def punctured(draw: Draw) -> physics.Punctured:
    return physics.Punctured(
        draw.k, 0.2 * draw.b, 2.0 * draw.amplitude * draw.uniform(0.6, 0.75), draw.uniform(0.1, 0.4)
    )


# Motions, drawn


def sine(draw: Draw, t: Array) -> Array:
    return physics.sine(
        t, draw.frequency, draw.amplitude, draw.centre, draw.uniform(0.0, 2.0 * math.pi)
    )


def about_zero(draw: Draw, t: Array) -> Array:
    return physics.sine(
        t, draw.frequency, draw.amplitude, draw.amplitude * draw.uniform(-0.15, 0.15)
    )


def several_sines(draw: Draw, t: Array) -> Array:
    factors = np.array([1.0, 1.73, 2.6, 3.9])[: int(draw.rng.integers(3, 5))]
    phases = draw.rng.uniform(0.0, 2.0 * math.pi, len(factors))
    frequencies = (draw.frequency * factors).tolist()
    return draw.centre + draw.amplitude * physics.multi_sine(t, frequencies, phases.tolist())


def triangle(draw: Draw, t: Array) -> Array:
    return draw.centre + draw.amplitude * physics.triangle(t, draw.frequency)


def hand(draw: Draw, t: Array) -> Array:
    wave = physics.hand(draw.rng, t, 0.3 * draw.frequency, 1.5 * draw.frequency)
    return draw.centre + draw.amplitude * wave


def presses(draw: Draw, t: Array) -> Array:
    lift = draw.amplitude * draw.uniform(0.2, 0.6)
    return physics.presses(draw.rng, t, 1.0 / draw.frequency, 2.0 * draw.amplitude, lift)


def deeper_presses(draw: Draw, t: Array) -> Array:
    """Return presses whose depth grows over the record, with a pause before each."""
    each = 1.0 / draw.frequency
    count = math.ceil(t[-1] / each)
    times = [each * (i + part) for i in range(count) for part in (0.0, 0.5, 0.9)]
    depths = [2.0 * draw.amplitude * (0.4 + 0.6 * (i + 1) / count) for i in range(count)]
    lift = -0.3 * draw.amplitude
    values = [value for depth in depths for value in (lift, depth, lift)]
    return physics.minimum_jerk(t, times, values)


def ramps_and_holds(draw: Draw, t: Array) -> Array:
    draw.centre = draw.amplitude
    ramp, hold = 0.4 / draw.frequency, 0.6 / draw.frequency
    low = -0.3 * draw.amplitude
    return physics.ramps_and_holds(t, ramp, hold, low, 2.0 * draw.amplitude)


def ramp_and_return(draw: Draw, t: Array) -> Array:
    low, top = -0.2 * draw.amplitude, 2.0 * draw.amplitude
    share = 1.0 - np.abs(2.0 * np.clip(t / draw.seconds, 0.05, 0.95) - 1.0) / 0.9
    return low + (top - low) * share


def away(draw: Draw, t: Array) -> Array:
    return -draw.centre - draw.amplitude * np.sin(draw.omega * t)


def into_a_stop(draw: Draw, t: Array) -> Array:
    """Return the encoder at the tip: it rests at the stop within a compliance of 1e-8 m/N."""
    drive = sine(draw, t)
    draw.resolution = draw.amplitude / 2000.0
    return 1e-8 * draw.k * drive


# Transmissions, drawn


def series(draw: Draw, x: Array, dt: float, body: Linear) -> tuple[Array, Array, Array]:
    slider = physics.Slider("coulomb", 0.0, draw.uniform(0.02, 0.2) / body.k)
    tip, force = slider.tip(x, dt, body.k, body.b)
    return tip, tip + slider.compliance * force, force


def gap(draw: Draw, x: Array, dt: float, body: Linear) -> tuple[Array, Array, Array]:
    width = draw.uniform(0.03, 0.15) * draw.amplitude
    draw.notes["lost motion"] = width
    tip, force = physics.gap(x, dt, body.k, body.b, width)
    return tip, tip, force


def slider(form: str, known: bool = False) -> Link:
    """Return friction on a slider; lost motion is 3 to 10 % of the amplitude."""

    def make(draw: Draw, x: Array, dt: float, body: Linear) -> tuple[Array, Array, Array]:
        compliance = draw.uniform(0.05, 0.2) / body.k
        lost = draw.uniform(0.03, 0.1) * draw.amplitude
        draw.notes["lost motion"] = lost
        friction = physics.Slider(form, lost / compliance, compliance, 0.3 * lost)
        if known:
            draw.options += ["--lost-motion", f"{lost * 1e6:.4f}um"]
            draw.options += ["--compliance", f"{compliance * 1e6:.6f}um/N"]
        tip, force = friction.tip(x, dt, body.k, body.b)
        return tip, tip + compliance * force, force

    return make


# Sensors


def lag(form: str, known: bool = False) -> Analog:
    """Return a lag of the force that changes tan delta by 0.1 to 0.4."""

    def apply(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
        dt, tau = t[1] - t[0], draw.uniform(0.1, 0.4) / draw.omega
        draw.notes["force lag"] = tau
        if known:
            draw.options += ["--force-lag", f"{tau * 1e3:.6f}ms"]
        if form == "delay":
            return x, physics.delayed(f, dt, tau)
        if form == "filter":
            return x, physics.low_pass(f, dt, math.sqrt(2.0) / (2.0 * math.pi * tau))
        return x, physics.first_order(f, dt, tau)

    return apply


def short_lag(form: str) -> Analog:
    """Return a known lag that is small against the period, as a force sensor has."""

    def apply(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
        dt, tau = t[1] - t[0], draw.uniform(0.02, 0.08) / draw.omega
        draw.options += ["--force-lag", f"{tau * 1e3:.6f}ms"]
        if form == "delay":
            return x, physics.delayed(f, dt, tau)
        return x, physics.first_order(f, dt, tau)

    return apply


def hum(low: float, high: float) -> Analog:
    def apply(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
        size = draw.uniform(low, high) * np.ptp(f)
        mains = draw.notes.get("mains", 50.0)
        return x, f + size * np.sin(2.0 * math.pi * mains * t + draw.uniform(0.0, 6.0))

    return apply


def sample_at_mains(draw: Draw) -> None:
    """Set the rate so that hum of 50 Hz appears at a multiple of the frequency of the motion."""
    multiple = int(draw.rng.integers(1, 4))
    draw.notes["multiple"] = multiple
    draw.rate = 50.0 - multiple * draw.frequency


def sample_near_mains(draw: Draw) -> None:
    """Set the rate so that hum of 50 Hz appears between two multiples of the motion."""
    draw.rate = 50.0 - draw.frequency * (int(draw.rng.integers(1, 4)) + draw.uniform(0.3, 0.7))


def sample_coarsely(draw: Draw) -> None:
    draw.rate = draw.frequency * draw.uniform(6.2, 8.0)
    draw.seconds = max(draw.seconds, 15.0 / draw.frequency)


def held_position(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    """Return a position that is updated 5 to 10 times more slowly than the file is written."""
    return physics.held(t, x, int(draw.rng.integers(5, 11)) / draw.rate), f


def held_force(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, physics.held(t, f, int(draw.rng.integers(5, 11)) / draw.rate)


def clock_drift(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, np.interp(t * (1.0 - 1e-3), t, f)


def saturated(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, np.minimum(f, f.min() + draw.uniform(0.55, 0.85) * np.ptp(f))


def drifting(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, f + draw.uniform(0.2, 0.6) * np.ptp(f) * t / draw.seconds


def surface_moves(draw: Draw, t: Array) -> Array:
    """Return presses on a surface that moves away by 0.5 to 1 amplitude."""
    return presses(draw, t)


def sign(force: float, position: float) -> Logged:
    def apply(draw: Draw, log: Log) -> Log:
        return Log(log.t, position * log.x, force * log.f)

    return apply


def ten_bit(draw: Draw, log: Log) -> Log:
    """Return a force of 10 bits, whose range is 1.2 to 4 times that of the record."""
    step = np.ptp(log.f) * draw.uniform(1.2, 4.0) / 1024.0
    return log._replace(f=physics.quantised(log.f, step))


def coarse_encoder(draw: Draw, log: Log) -> Log:
    step = np.ptp(log.x) / draw.uniform(20.0, 60.0)
    return log._replace(x=physics.quantised(log.x, step))


def dropouts(draw: Draw, log: Log) -> Log:
    """Return a log in which 5 % of the rows, and two blocks of 0.2 s, are missing."""
    kept = draw.rng.random(len(log.t)) > 0.05
    for begin in draw.rng.uniform(0.1, 0.9, 2) * draw.seconds:
        kept &= (log.t < begin) | (log.t > begin + 0.2)
    return Log(*(channel[kept] for channel in log))


def duplicated(draw: Draw, log: Log) -> Log:
    n = np.arange(len(log.t))
    n = np.sort(np.concatenate([n, draw.rng.choice(n, len(n) // 50)]))
    return Log(*(channel[n] for channel in log))


def stalled(channel: str, at_end: bool) -> Logged:
    """Return a log in which a channel keeps its value for 15 to 30 % of the time."""

    def apply(draw: Draw, log: Log) -> Log:
        length = round(draw.uniform(0.15, 0.3) * len(log.t))
        begin = len(log.t) - length if at_end else round(draw.uniform(0.3, 0.6) * len(log.t))
        values = getattr(log, channel).copy()
        values[begin : begin + length] = values[begin]
        return log._replace(**{channel: values})

    return apply


def spikes(draw: Draw, log: Log) -> Log:
    f = log.f.copy()
    where = draw.rng.choice(len(f), 10, replace=False)
    f[where] += draw.rng.choice([-1.0, 1.0], 10) * draw.uniform(1.0, 5.0) * np.ptp(log.f)
    return log._replace(f=f)


def coloured(draw: Draw, log: Log) -> Log:
    std = draw.noise * np.ptp(log.f)
    noise = physics.coloured(draw.rng, len(log.f), 1.0 / draw.rate, 0.1, std)
    return log._replace(f=log.f + noise)


RELAXES = r"force relaxes|baseline"
DEPTH = r"depends on depth"
GROWS = r"damping (grows|depends|increases|changes)"
ONE_SPEED = r"speed in contact is constant"
LOST = r"lost motion|motion is lost|\bplay\b|backlash|dead (band|zone)"
CHANGES = r"stiffness changes (over|at|in|from|between|during)|soften"
HELD = r"held|repeated|updated|holds? (each|its|every)"
STALLED = r"stall|frozen|stuck|stays constant|no new|stops? changing"
CLOCK = r"\bclocks?\b|time stamps|lag (changes|grows|shifts)|out of step"
HUM = r"\bhum\b|mains|interference"
LAG = r"\blags?\b|\bdelay"
SIGN = r"\bsigns?\b|invert|(force|position) (and position )?positive in compression"
INERTIA = r"\bmass|inertia"
FRICTION = r"friction"

# fmt: off
KINDS = [
    # Without a fault, and one stiffness
    Kind("linear, sine", linear, sine, True),
    Kind("linear, several sines", linear, several_sines, ranges={"frequency": (0.2, 1.0)}),
    Kind("linear, hand", linear, hand, ranges={"frequency": (0.5, 3.0)}),
    Kind("linear, triangle", linear, triangle, allowed=ONE_SPEED),
    Kind("linear, presses", linear, presses, ranges={"frequency": (0.2, 1.5)}),
    Kind("linear, ramps, holds", linear, ramps_and_holds, ranges={"frequency": (0.2, 0.8)},
         allowed=ONE_SPEED),
    Kind("linear, ramp, return", linear, ramp_and_return, allowed=ONE_SPEED + "|one ramp",
         ranges={"loss": (0.001, 0.01)}),
    Kind("Fung, sine", stiffening, sine, True, allowed=DEPTH),
    Kind("Fung, presses", stiffening, presses, ranges={"frequency": (0.2, 1.5)}, allowed=DEPTH),
    Kind("power law, presses", power, presses, ranges={"frequency": (0.2, 1.5)}, allowed=DEPTH),
    Kind("sphere, presses", sphere, presses, ranges={"frequency": (0.2, 1.5)}, allowed=DEPTH),
    Kind("springpot, sine", springpot, sine, True, allowed=RELAXES),
    Kind("springpot, ramps", springpot, triangle, ranges={"frequency": (0.2, 0.5)},
         allowed=RELAXES + "|" + ONE_SPEED),
    Kind("Maxwell arms, sine", solid, sine, True, allowed=RELAXES),
    Kind("Maxwell arms, ramps", solid, ramps_and_holds, ranges={"frequency": (0.2, 0.5)},
         allowed=RELAXES + "|" + ONE_SPEED),
    Kind("Fung, hand", stiffening, hand, ranges={"frequency": (0.5, 3.0)}, allowed=DEPTH),
    Kind("QLV, presses", quasi_linear, presses, ranges={"frequency": (0.3, 1.5)},
         allowed=f"{RELAXES}|{DEPTH}"),
    Kind("QLV, sine", quasi_linear, sine, True, allowed=RELAXES + "|" + DEPTH),
    Kind("QLV, triangle", quasi_linear, triangle, allowed=f"{RELAXES}|{DEPTH}|{ONE_SPEED}"),
    Kind("poroelastic, sine", consolidating, sine, True, allowed=RELAXES),
    Kind("poroelastic, ramps", consolidating, ramps_and_holds, ranges={"frequency": (0.2, 0.5)},
         allowed=RELAXES + "|" + ONE_SPEED),
    Kind("layers, sharp", layers((3.0, 10.0), 0.0, (0.3, 0.7)), presses,
         ranges={"frequency": (0.2, 1.0), "loss": (0.01, 0.1)}, allowed=DEPTH + "|layer"),
    Kind("layers, smooth", layers((2.0, 6.0), 0.1, (0.3, 0.7)), sine, True,
         allowed=DEPTH + "|layer"),
    Kind("thin soft layer", layers((4.0, 10.0), 0.03, (0.05, 0.12)), presses,
         ranges={"frequency": (0.2, 1.0), "loss": (0.01, 0.1)}, allowed=DEPTH + "|layer"),
    Kind("Hunt-Crossley, presses", depth_damped(None, 0.1, 0.3), presses,
         ranges={"frequency": (0.3, 1.5)}, allowed=DEPTH + "|" + GROWS),
    Kind("Hunt-Crossley, sine", depth_damped(None, 0.1, 0.3), sine, True,
         allowed=DEPTH + "|" + GROWS),
    Kind("Hunt-Crossley n = 1", depth_damped(1.0, 0.1, 0.3), presses,
         ranges={"frequency": (0.3, 1.5)}, allowed=GROWS),
    Kind("adhesion", adhesive, presses, ranges={"frequency": (0.2, 1.0)}, allowed="adhesion"),
    Kind("Coulomb inside", with_friction(0.002), sine, True, allowed=FRICTION),
    Kind("Dahl inside", with_friction(0.1), sine, True, allowed=FRICTION),
    Kind("compliance in series", linear, sine, True, series),
    Kind("AR(1) noise", linear, sine, True, logged=(coloured,), white=False,
         ranges={"frequency": (0.3, 3.0)}),
    Kind("10-bit force", linear, hand, logged=(ten_bit,), ranges={"frequency": (0.5, 3.0)}),
    Kind("coarse encoder", linear, sine, True, logged=(coarse_encoder,)),
    Kind("jitter", linear, sine, True, jitter=0.25),
    Kind("dropouts", linear, sine, True, logged=(dropouts,)),
    Kind("duplicated rows", linear, sine, True, logged=(duplicated,),
         allowed="time of the previous|duplicate"),
    Kind("6 to 8 samples a cycle", linear, sine, True, prepare=sample_coarsely),
    Kind("known lag", linear, sine, True, analog=(short_lag("first order"),)),
    Kind("known delay", linear, sine, True, analog=(short_lag("delay"),)),
    Kind("known lost motion", linear, sine, True, slider("coulomb", known=True)),
    # With a fault
    Kind("gap, bonded", bonded, about_zero, True, gap, cause=LOST),
    Kind("Coulomb link", linear, sine, True, slider("coulomb"), cause=LOST),
    Kind("Coulomb link, hand", linear, hand, False, slider("coulomb"), cause=LOST,
         ranges={"frequency": (0.5, 2.0)}),
    Kind("Dahl link", linear, sine, True, slider("dahl"), cause=LOST),
    Kind("LuGre link", linear, sine, True, slider("lugre"), cause=LOST),
    Kind("Bouc-Wen link", linear, sine, True, slider("bouc-wen"), cause=LOST),
    Kind("force lag", linear, sine, True, analog=(lag("first order"),), cause=LAG),
    Kind("force delay", linear, sine, True, analog=(lag("delay"),), cause=LAG),
    Kind("filtered force", linear, hand, analog=(lag("filter"),), cause=LAG + "|filter",
         ranges={"frequency": (0.5, 2.0)}),
    Kind("mass", linear, sine, True, mass=True, cause=INERTIA,
         ranges={"frequency": (2.0, 4.0), "k": (300.0, 3000.0)}),
    Kind("step that returns", step_that_returns, sine, True, cause=CHANGES, has_k=False),
    Kind("softening", softening, presses, ranges={"frequency": (0.4, 1.5)}, cause=CHANGES,
         has_k=False),
    Kind("heating", heating, sine, True, cause=CHANGES, has_k=False),
    Kind("puncture", punctured, deeper_presses, ranges={"frequency": (0.2, 0.6)}, cause="punctur",
         has_k=False),
    Kind("rigid stop", linear, into_a_stop, cause=r"rigid|\bstop\b|does not resolve", has_k=False),
    Kind("sliding tip", linear, surface_moves, cause=r"slid|slip|surface|baseline|drift",
         ranges={"frequency": (0.4, 1.5)}),
    Kind("no contact", linear, away, cause="contact", has_k=False),
    Kind("held position", linear, sine, True, analog=(held_position,), cause=HELD,
         ranges={"rate": (400.0, 2000.0)}),
    Kind("held force", linear, sine, True, analog=(held_force,), cause=HELD,
         ranges={"rate": (400.0, 2000.0)}),
    Kind("clock drift", linear, sine, True, analog=(clock_drift,), cause=CLOCK,
         ranges={"frequency": (0.5, 4.0)}),
    Kind("force stalls at the end", linear, sine, True, logged=(stalled("f", True),),
         cause=STALLED),
    Kind("position stalls", linear, sine, True, logged=(stalled("x", False),), cause=STALLED),
    Kind("sign of the force", linear, sine, True, logged=(sign(-1.0, 1.0),), cause=SIGN,
         has_k=False),
    Kind("sign, presses", linear, presses, logged=(sign(-1.0, 1.0),), cause=SIGN, has_k=False,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("sign of both", linear, presses, logged=(sign(-1.0, -1.0),), cause=SIGN,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("hum on a multiple", linear, sine, True, analog=(hum(0.05, 0.4),), cause=HUM,
         prepare=sample_at_mains, ranges={"frequency": (0.3, 1.2)}),
    Kind("hum between multiples", linear, sine, True, analog=(hum(0.05, 0.3),), cause=HUM,
         prepare=sample_near_mains, ranges={"frequency": (0.3, 1.2)}),
    Kind("hum", linear, hand, analog=(hum(0.05, 0.2),), cause=HUM,
         ranges={"frequency": (0.5, 3.0), "rate": (200.0, 2000.0)}),
    Kind("saturation", linear, sine, True, analog=(saturated,), cause="saturat", has_k=False),
    Kind("spikes", linear, sine, True, logged=(spikes,), cause="spike|outlier"),
    Kind("drift of the force", linear, sine, True, analog=(drifting,), cause="drift|baseline"),
]
# fmt: on


@dataclass(frozen=True)
class Case:
    """A record, and what is true of it."""

    kind: Kind
    seed: int
    draw: Draw
    log: Log
    truth: Physics
    body: Made

    def write(self, folder: Path) -> Path:
        name = re.sub(r"[^a-z0-9]+", "-", self.kind.name.lower())
        path = folder / f"{name}-{self.seed}.csv"
        table = np.column_stack([self.log.t, self.log.x * 1e3, self.log.f])
        header = "time_s,position_mm,force_N"
        np.savetxt(path, table, ["%.6f", "%.7g", "%.7g"], ",", header=header, comments="")
        return path

    @property
    def viscous(self) -> Viscous | None:
        """The part of the body whose force depends only on depth and velocity."""
        body = self.body.body if isinstance(self.body, WithFriction) else self.body
        return body if isinstance(body, Viscous) else None

    @property
    def is_linear(self) -> bool:
        """Whether the storage stiffness is the only stiffness."""
        linear_law = self.kind.body in (solid, consolidating, springpot)
        return isinstance(self.body, Linear) or linear_law

    @functools.cached_property
    def complex_stiffness(self) -> complex:
        truth = self.truth
        return physics.complex_stiffness(truth.t, truth.tip, truth.body, self.draw.frequency)

    def stiffnesses(self, force: float, named_storage: bool = False) -> list[float]:
        """Return the true stiffnesses at a force of the record; empty if there is none."""
        if not self.kind.has_k:
            return []
        truth, found = self.truth, []
        if self.kind.steady and (self.is_linear or named_storage):
            found.append(self.complex_stiffness.real)
            if self.is_linear:
                return found
        if self.kind.steady:
            v = np.gradient(truth.tip, truth.t)
            beside_loss = truth.body - self.complex_stiffness.imag / self.draw.omega * v
            found.append(physics.loading_slope(truth.tip, beside_loss, force))
        if not isinstance(self.body, Linear) or self.kind.link:
            found.append(physics.loading_slope(truth.tip, truth.body, force))
        depth, viscous = self.depth_at(force), self.viscous
        if viscous and self.kind.link is None and depth is not None:
            found.append(float(viscous.tangent(np.array(depth))))
            d = np.sort(truth.depth)
            static = np.interp(force, viscous.elastic(d), d)
            found.append(float(viscous.tangent(np.array(static))))
        if isinstance(self.body, physics.Adhesive):
            found.append(self.body.k)
        return [k for k in found if k is not None]

    def depth_at(self, force: float) -> float | None:
        """Return the mean depth at which the force is loaded to a value; None if it never is."""
        truth = self.truth
        near = np.abs(truth.body - force) < 0.02 * np.ptp(truth.body)
        near &= np.gradient(truth.depth) > 0.0
        return float(truth.depth[near].mean()) if near.any() else None

    def damping(self, force: float, at_frequency: bool) -> float | None:
        """Return the true b; None if it is not defined."""
        if not self.kind.has_k:
            return None
        if self.kind.steady and (at_frequency or isinstance(self.body, Linear)):
            return self.complex_stiffness.imag / self.draw.omega
        if self.kind.link:
            return None
        if at_frequency:
            return self.loss_per_velocity
        if isinstance(self.body, physics.Adhesive):
            return self.body.b
        depth = self.depth_at(force)
        if self.viscous is None or depth is None:
            return None
        return float(self.viscous.viscosity(np.array(depth)))

    @property
    def loss_per_velocity(self) -> float:
        """b that dissipates the same energy in contact."""
        truth = self.truth
        touching = truth.depth > 0.0
        d = truth.depth[touching] / np.ptp(truth.depth)
        v = np.gradient(truth.depth, truth.t)[touching]
        columns = np.column_stack([np.ones_like(d), d, d**2, d**3, v])
        return float(np.linalg.lstsq(columns, truth.body[touching], rcond=None)[0][-1])


def simulate(kind: Kind, seed: int, repeat: int) -> Case:
    """Return a case of a kind; the same numbers give the same case."""
    rng = np.random.default_rng([zlib.crc32(kind.name.encode()), seed, repeat])
    draw = Draw(rng, **kind.ranges)
    if kind.prepare:
        kind.prepare(draw)
    body = kind.body(draw)
    factor = math.ceil(SIMULATED_RATE / draw.rate)
    dt = 1.0 / (factor * draw.rate)
    before = math.ceil((10.0 if isinstance(body, Springpot) else 3.0) / dt) * dt
    t = np.arange(round((before + draw.seconds) / dt)) * dt - before
    x = kind.motion(draw, t)
    if kind.link:
        depth, tip, force = kind.link(draw, x, dt, body)
    elif kind.name == "rigid stop":
        depth = tip = x
        force = 1e8 * x
    else:
        moved = x
        if kind.motion is surface_moves:
            moved = x - draw.uniform(0.5, 1.0) * draw.amplitude * t / draw.seconds
        depth = tip = moved
        force = body.force(t, moved)
    sensor = force
    if kind.mass:
        mass = draw.uniform(0.1, 0.4) * draw.k / draw.omega**2
        draw.notes["mass"] = mass
        sensor = force + mass * np.gradient(np.gradient(x, t), t)
    # The sensors start one second before the record, after the start of the motion.
    use = slice(round((before - 1.0) / dt), None)
    at, measured_x, measured_f = t[use], x[use] + draw.origin, sensor[use]
    for change in kind.analog:
        measured_x, measured_f = change(draw, at, measured_x, measured_f)
    n = np.arange(1, round(draw.seconds * draw.rate) - 1)
    times = (n + kind.jitter * np.clip(rng.normal(size=len(n)), -1.9, 1.9)) / draw.rate
    log = sampled(draw, kind, at, measured_x, measured_f, times)
    for change in kind.logged:
        log = change(draw, log)
    n = np.arange(round(before / dt), len(t), max(1, round(1.0 / (TRUTH_RATE * dt))))
    truth = Physics(t[n], x[n], tip[n], force[n], sensor[n], depth[n])
    return Case(kind, repeat, draw, log, truth, body)


def sampled(draw: Draw, kind: Kind, t: Array, x: Array, f: Array, times: Array) -> Log:
    """Return position and force at the sampling times, with the noise of their sensors."""
    position = np.interp(times, t, x) if kind.analog != (held_position,) else nearest(times, t, x)
    force = np.interp(times, t, f) if kind.analog != (held_force,) else nearest(times, t, f)
    noise_f = draw.rng.normal(0.0, draw.noise * max(float(np.ptp(f)), 1e-3), len(times))
    noise_x = draw.rng.normal(0.0, 0.5 * draw.resolution, len(times))
    if kind.analog == (held_position,):
        noise_x = repeated_with(position, noise_x)
    if kind.analog == (held_force,):
        noise_f = repeated_with(force, noise_f)
    if not kind.white:
        noise_f *= 0.1
    position = physics.quantised(position + noise_x, draw.resolution)
    return Log(times, position, force + noise_f)


def nearest(times: Array, t: Array, values: Array) -> Array:
    return np.asarray(values[np.round((times - t[0]) / (t[1] - t[0])).astype(int)])


def repeated_with(values: Array, noise: Array) -> Array:
    """Return noise that changes only where a channel has a new value."""
    group = np.cumsum(np.diff(values, prepend=values[0]) != 0.0)
    return noise[np.searchsorted(group, group)]


# Verdicts


def answer(path: Path, options: Iterable[str]) -> dict[str, Any]:
    """Return the result of `teleop estimate`, or the error message as the reason for no result."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = teleop(["estimate", str(path), *options, "--json"])
    if code == 2:
        return {"identifiable": False, "reasons": [err.getvalue().strip().splitlines()[-1]]}
    document: dict[str, Any] = json.loads(out.getvalue())
    result: dict[str, Any] = document["result"]
    result["reasons"] = result["reasons"] + document["reading"]
    return result


class Judged(NamedTuple):
    """The truth nearest to a number of the result, and the verdict."""

    truth: float | None
    verdict: str


def judge_k(case: Case, result: dict[str, Any], named: bool) -> Judged:
    k = result.get("k")
    if not result["identifiable"] or k is None:
        if named:
            return Judged(None, "named")
        return Judged(None, "refused" if case.kind.has_k else "unnamed")
    stated = str((result.get("kinds") or {}).get("k", ""))
    truths = case.stiffnesses(result["tangent"]["force_n"], "storage" in stated)
    if not truths:
        return Judged(None, "named" if named else "WRONG")
    truth = min(truths, key=lambda value: abs(value - k))
    if any(result["k_low"] <= value <= result["k_high"] for value in truths):
        return Judged(truth, "right")
    error = abs(k / truth - 1.0)
    if error < CLOSE:
        return Judged(truth, "right")
    return Judged(truth, "named" if named else "near" if error < NEAR else "WRONG")


def judge_b(case: Case, result: dict[str, Any], named: bool) -> Judged:
    b = result.get("b")
    if not result["identifiable"] or not case.kind.has_k:
        return Judged(None, "-")
    at_frequency = result.get("damping_at_hz") is not None
    truth = case.damping(result["tangent"]["force_n"], at_frequency)
    if truth is None:
        return Judged(None, "-")
    constant_speed = any(re.search(ONE_SPEED, reason) for reason in result["reasons"])
    if b is None or constant_speed:
        return Judged(truth, "named" if named or constant_speed else "refused")
    slack = CLOSE_LOSS * abs(result["k"]) / case.draw.omega
    error = abs(b - truth)
    if result["b_low"] <= truth <= result["b_high"] or error < max(slack, CLOSE * abs(truth)):
        return Judged(truth, "right")
    return Judged(truth, "named" if named else "near" if error < NEAR * abs(truth) else "WRONG")


def claims(reason: str) -> list[str]:
    """Return the parts of a remark that state different causes."""
    inside = re.fullmatch(r"(Kelvin-Voigt is insufficient: )(.*)(; residual.*)", reason, re.DOTALL)
    if inside is None:
        return [reason]
    return [inside[1] + part + inside[3] for part in inside[2].split(" and ")]


def evaluate(case: Case, path: Path) -> dict[str, Any]:
    """Return the verdicts on a case, as they are written by --json."""
    result = answer(path, case.draw.options)
    kind, reasons = case.kind, [str(reason) for reason in result["reasons"]]
    named = bool(kind.cause) and any(re.search(kind.cause, reason, re.I) for reason in reasons)
    allowed = "|".join(filter(None, [ALWAYS_ALLOWED, kind.allowed]))
    alarms = [c for r in reasons for c in claims(r) if not re.search(allowed, c, re.I)]
    if kind.cause or not result["identifiable"]:
        alarms = []
    k, b = judge_k(case, result, named), judge_b(case, result, named)
    return {
        "kind": kind.name,
        "repeat": case.seed,
        "k": k._asdict(),
        "b": b._asdict(),
        "false_alarms": alarms,
        "named": named,
        "result": result,
        "options": case.draw.options,
        "drawn": {
            "k": case.draw.k,
            "b": case.draw.b,
            "frequency_hz": case.draw.frequency,
            "amplitude_m": case.draw.amplitude,
            "noise": case.draw.noise,
            "rate_hz": case.draw.rate,
            "seconds": case.draw.seconds,
            "tan_delta": case.draw.loss,
            **case.draw.notes,
        },
    }


def line(number: int, row: dict[str, Any]) -> str:
    result, texts = row["result"], []
    for symbol in "kb":
        shown = [
            f"{value:.4g}" if value is not None else "-"
            for value in (
                row[symbol]["truth"],
                *(result.get(symbol + end) for end in ("", "_low", "_high")),
            )
        ]
        estimate = f"{shown[1]} [{shown[2]}, {shown[3]}]"
        texts.append(f"{shown[0]:>9} {estimate:30} {row[symbol]['verdict']:8}")
    alarm = " FALSE ALARM" if row["false_alarms"] else ""
    reasons = row["false_alarms"] or result["reasons"]
    first = reasons[0].replace("\n", " ")[:90] if reasons else ""
    name = f"{row['kind']} {row['repeat']}"
    return f"{number:3} {name:26} k {texts[0]} b {texts[1]}{alarm} {first}".rstrip()


VERDICTS = ("right", "named", "near", "WRONG", "refused", "unnamed", "-")


def summary(rows: list[dict[str, Any]]) -> str:
    """Return the table of the kinds, and the totals."""
    head = " ".join(f"{verdict:>7}" for verdict in VERDICTS[:-1])
    lines = [f"{'kind':26} k {head}  b {head}  alarm"]
    for name in dict.fromkeys(row["kind"] for row in rows):
        of_kind = [row for row in rows if row["kind"] == name]
        cells = []
        for symbol in "kb":
            counts = Counter(row[symbol]["verdict"] for row in of_kind)
            cells.append(" ".join(f"{counts[v] or '.':>7}" for v in VERDICTS[:-1]))
        alarms = sum(bool(row["false_alarms"]) for row in of_kind)
        lines.append(f"{name:26} k {cells[0]}  b {cells[1]}  {alarms or '.':>5}")
    counts = {s: Counter(row[s]["verdict"] for row in rows) for s in "kb"}
    clean = sum(not kind.cause for kind in KINDS for row in rows if row["kind"] == kind.name)
    alarms = sum(bool(row["false_alarms"]) for row in rows)

    def total(verdict: str) -> str:
        return f"k {counts['k'][verdict]}, b {counts['b'][verdict]}"

    lines += [
        f"{len(rows)} cases of {len({row['kind'] for row in rows})} kinds",
        f"silent wrong answers: {total('WRONG')}",
        f"between the interval and 10 %: {total('near')}",
        f"needless refusals: {total('refused')}",
        f"withheld for another reason than the cause: {total('unnamed')}",
        f"false alarms: {alarms} of {clean} records without a fault",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=250)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", default="", help="regular expression of the names of the kinds")
    parser.add_argument("--only", type=int, help="number of the case to evaluate, from 1")
    parser.add_argument("--keep", type=Path, help="folder for the CSV files")
    parser.add_argument("--json", type=Path, help="file for all results")
    chosen = parser.parse_args()
    wanted = re.compile(chosen.kind)
    if chosen.keep:
        chosen.keep.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        for number in range(1, chosen.cases + 1):
            kind, repeat = KINDS[(number - 1) % len(KINDS)], (number - 1) // len(KINDS)
            if chosen.only not in (None, number) or not wanted.search(kind.name):
                continue
            case = simulate(kind, chosen.seed, repeat)
            path = case.write(chosen.keep or Path(temporary))
            rows.append(evaluate(case, path) | {"number": number})
            print(line(number, rows[-1]), flush=True)
            if not chosen.keep:
                path.unlink()
    print("\n" + summary(rows))
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
