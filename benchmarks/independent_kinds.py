"""The kinds of record of `independent.py`: body, motion, transmission, sensors, and their fault.

A case of a kind is drawn at random. Its body, motion and faults are functions of the `Draw`, which
has the values that all kinds share.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import independent_bodies as physics
import numpy as np
from independent_bodies import Array, Linear, Relaxing, Springpot, Viscous, WithFriction

MOST_ROWS = 15_000
"""Limits the time of an evaluation."""

RIGID = 1e8
"""Stiffness of a rigid stop [N/m]."""

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
    surface: Callable[[Draw, Array, Array], Array] | None = None
    """Position of the surface of the body over time and position; None if it rests."""


# Bodies, drawn


def linear(draw: Draw) -> Linear:
    return physics.kelvin_voigt(draw.k, draw.b)


def bonded(draw: Draw) -> Linear:
    return physics.kelvin_voigt(draw.k, draw.b, bonded=True)


def rigid(draw: Draw) -> Linear:
    return physics.kelvin_voigt(RIGID, 0.0)


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


def with_friction(
    slip: float, body: Callable[[Draw], Linear] = bonded
) -> Callable[[Draw], WithFriction]:
    """Return a body with friction inside it; `slip` is relative to the amplitude."""

    def make(draw: Draw) -> WithFriction:
        friction = draw.uniform(0.03, 0.12) * draw.k * draw.amplitude
        return WithFriction(body(draw), friction, slip * draw.amplitude)

    return make


def damper(draw: Draw) -> Linear:
    """Return a body that resists only the velocity, and the drawn stiffness at the frequency."""
    return physics.kelvin_voigt(0.0, draw.k / draw.omega, bonded=True)


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


def light_presses(draw: Draw, t: Array) -> Array:
    """Return presses of which only the last 3 to 8 % of the travel are in contact."""
    travel = 2.0 * draw.amplitude
    return physics.presses(
        draw.rng, t, 1.0 / draw.frequency, travel * draw.uniform(0.03, 0.08), travel, 0.95
    )


def away(draw: Draw, t: Array) -> Array:
    return -draw.centre - draw.amplitude * np.sin(draw.omega * t)


def against_a_stop(draw: Draw, t: Array) -> Array:
    """Return the position of an encoder at the tip, whose drive moves by the drawn motion."""
    draw.resolution = draw.amplitude / 2000.0
    return sine(draw, t) * draw.k / RIGID


def sliding(draw: Draw, t: Array, x: Array) -> Array:
    """Return a surface along which the tip slides downhill."""
    return 0.8 * draw.amplitude * t / draw.seconds


def compacted(draw: Draw, t: Array, x: Array) -> Array:
    """Return a surface that the loadings lower by 2 to 10 % of their depth, at first the most."""
    path = np.cumsum(
        np.where((x > 0.0) & (t > 0.0), np.maximum(np.diff(x, prepend=x[0]), 0.0), 0.0)
    )
    lowered = 2.0 * draw.amplitude * draw.uniform(0.02, 0.1)
    return lowered * (1.0 - np.exp(-path / (path[-1] * draw.uniform(0.15, 0.5))))


def preconditioned(draw: Draw, t: Array, x: Array) -> Array:
    """Return a surface that the presses lower by 2 to 10 % of their depth, at first the most."""
    lowered = 2.0 * draw.amplitude * draw.uniform(0.02, 0.1)
    return lowered * (1.0 - np.exp(-np.maximum(t, 0.0) / (draw.seconds * draw.uniform(0.15, 0.5))))


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
        draw.notes |= {"lost motion": lost, "compliance": compliance}
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


def hum(low: float, high: float, exact: bool = False) -> Analog:
    """Return hum of the mains, which differ from 50 Hz by 10 to 50 mHz unless it is exact."""

    def apply(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
        size = draw.uniform(low, high) * np.ptp(f)
        mains = 50.0
        if not exact:
            mains += draw.uniform(0.01, 0.05) * draw.rng.choice([-1.0, 1.0])
        return x, f + size * np.sin(2.0 * math.pi * mains * t + draw.uniform(0.0, 6.0))

    return apply


def sample_at_mains(draw: Draw) -> None:
    """Set the rate so that hum of 50 Hz appears at a multiple of the frequency of the motion."""
    multiple = int(draw.rng.integers(1, 4))
    draw.notes["multiple"] = multiple
    draw.rate = 50.0 - multiple * draw.frequency


def sample_at_mains_exactly(draw: Draw) -> None:
    """As before, at the second or third multiple: hum at the frequency itself cannot be seen."""
    draw.rate = 50.0 - int(draw.rng.integers(2, 4)) * draw.frequency


def sample_near_mains(draw: Draw) -> None:
    """Set the rate so that hum of 50 Hz appears between two multiples of the motion."""
    draw.rate = 50.0 - draw.frequency * (int(draw.rng.integers(1, 4)) + draw.uniform(0.3, 0.7))


def sample_coarsely(draw: Draw) -> None:
    draw.rate = draw.frequency * draw.uniform(6.2, 8.0)
    draw.seconds = max(draw.seconds, 15.0 / draw.frequency)


def clock_drift(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, np.interp(t * (1.0 - 1e-3), t, f)


def saturated(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, np.minimum(f, f.min() + draw.uniform(0.55, 0.85) * np.ptp(f))


def drifting(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    return x, f + draw.uniform(0.2, 0.6) * np.ptp(f) * t / draw.seconds


def drifting_slowly(draw: Draw, t: Array, x: Array, f: Array) -> tuple[Array, Array]:
    """Return a force with a drift of 2 to 15 % of its range, at a constant or decreasing rate."""
    s = np.maximum(t, 0.0) / draw.seconds
    if draw.rng.random() < 0.5:
        s = -np.expm1(-2.0 * s) / -math.expm1(-2.0)
    return x, f + draw.uniform(0.02, 0.15) * draw.rng.choice([-1.0, 1.0]) * np.ptp(f) * s


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


def held(channel: str) -> Logged:
    """Return a log with a channel that is updated 5 to 10 times more slowly than it is written."""

    def apply(draw: Draw, log: Log) -> Log:
        n = np.arange(len(log.t))
        return log._replace(**{channel: getattr(log, channel)[n - n % draw.rng.integers(5, 11)]})

    return apply


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


LINEAR_BODIES = (solid, consolidating, springpot)
"""Bodies that relax, whose storage stiffness does not depend on depth and amplitude."""

ALWAYS_ALLOWED = (
    r"damping is not resolved|motion and noise do not determine b|^few samples|^inertia: 100 g"
    r"|^a lag of the force is not known|friction in the specimen would have the same effect"
)
RELAXES = r"force relaxes|relaxation of the force|baseline"
DEPTH = r"depends on depth"
LAYER = DEPTH + "|changes at a depth"
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
MOVES = r"contact point|surface"
LIGHT = r"contact is too short|contact is short"

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
    Kind("QLV, sine", quasi_linear, sine, True, allowed=f"{RELAXES}|{DEPTH}|from relaxation"),
    Kind("QLV, triangle", quasi_linear, triangle, allowed=f"{RELAXES}|{DEPTH}|{ONE_SPEED}"),
    Kind("poroelastic, sine", consolidating, sine, True, allowed=RELAXES),
    Kind("poroelastic, ramps", consolidating, ramps_and_holds, ranges={"frequency": (0.2, 0.5)},
         allowed=RELAXES + "|" + ONE_SPEED),
    Kind("layers, sharp", layers((3.0, 10.0), 0.0, (0.3, 0.7)), presses,
         ranges={"frequency": (0.2, 1.0), "loss": (0.01, 0.1)}, allowed=LAYER),
    Kind("layers, smooth", layers((2.0, 6.0), 0.1, (0.3, 0.7)), sine, True,
         allowed=LAYER),
    Kind("thin soft layer", layers((4.0, 10.0), 0.03, (0.05, 0.12)), presses,
         ranges={"frequency": (0.2, 1.0), "loss": (0.01, 0.1)}, allowed=LAYER),
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
    Kind("6 to 8 samples a cycle", linear, sine, True, prepare=sample_coarsely,
         allowed="^conditioning at"),
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
    Kind("rigid stop", rigid, against_a_stop, cause=r"rigid|\bstop\b|does not resolve",
         has_k=False),
    Kind("sliding tip", linear, presses, surface=sliding, cause=r"slid|slip|surface|baseline|drift",
         ranges={"frequency": (0.4, 1.5)}),
    Kind("no contact", linear, away, cause="contact", has_k=False),
    Kind("held position", linear, sine, True, logged=(held("x"),), cause=HELD,
         ranges={"rate": (400.0, 2000.0)}),
    Kind("held force", linear, sine, True, logged=(held("f"),), cause=HELD,
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
    Kind("hum exactly on a multiple", linear, sine, True, analog=(hum(0.05, 0.4, exact=True),),
         cause=HUM, prepare=sample_at_mains_exactly, ranges={"frequency": (0.3, 1.2)}),
    Kind("hum between multiples", linear, sine, True, analog=(hum(0.05, 0.3),), cause=HUM,
         prepare=sample_near_mains, ranges={"frequency": (0.3, 1.2)}),
    Kind("hum", linear, hand, analog=(hum(0.05, 0.2),), cause=HUM,
         ranges={"frequency": (0.5, 3.0), "rate": (200.0, 2000.0)}),
    Kind("saturation", linear, sine, True, analog=(saturated,), cause="saturat", has_k=False),
    Kind("spikes", linear, sine, True, logged=(spikes,), cause="spike|outlier"),
    Kind("drift of the force", linear, sine, True, analog=(drifting,), cause="drift|baseline"),
    Kind("slow drift, presses", linear, presses, analog=(drifting_slowly,), cause="drift",
         ranges={"frequency": (0.2, 1.5)}),
    Kind("slow drift, Fung", stiffening, presses, analog=(drifting_slowly,), cause="drift",
         ranges={"frequency": (0.2, 1.5)}),
    Kind("slow drift, QLV", quasi_linear, presses, analog=(drifting_slowly,), cause="drift",
         ranges={"frequency": (0.2, 1.5)}),
    Kind("slow drift, ramps, holds", linear, ramps_and_holds, analog=(drifting_slowly,),
         cause="drift", ranges={"frequency": (0.2, 0.8)}),
    Kind("preconditioning", linear, presses, surface=preconditioned, cause=MOVES,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("compaction", linear, presses, surface=compacted, cause=MOVES,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("compaction, Fung", stiffening, presses, surface=compacted, cause=MOVES,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("preconditioning, Fung", stiffening, presses, surface=preconditioned, cause=MOVES,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("Coulomb inside, presses", with_friction(0.02, linear), presses, cause=FRICTION,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("Dahl inside, presses", with_friction(0.1, linear), presses, cause=FRICTION,
         ranges={"frequency": (0.2, 1.5)}),
    Kind("damper, sine", damper, about_zero, True, cause="viscous|damper", has_k=False),
    Kind("light contact", linear, light_presses, ranges={"frequency": (0.2, 1.5)},
         allowed=LIGHT),
]
# fmt: on
