"""Virtual coupling: a spring and a damper that make a velocity axis of a drive with a force input.

The rig commands the velocity of a proxy, a massless point. The spring and the damper connect the
proxy with the moving part that the drive pushes. The force of the coupling on the proxy is the
force with which the moving part, and the hand that holds it, act on the rig. Its negative is the
command of the drive [1].

[1] J. E. Colgate, M. C. Stanley, J. M. Brown, Issues in the haptic display of tool use, Proc.
IEEE/RSJ IROS, 1995.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

WINDOW = 0.1
"""Time constant with which the energy balance of a coupling forgets [s]."""
NOTICEABLE = 1e-4
"""Generated energy that is not reported, because it can be caused by sensor noise [J]."""
GENERATED = 0.03
"""Largest ratio of the generated energy to the energy that passes through the coupling."""
GENERATED_BY_LOOP = 0.4
"""The same for a velocity loop, which must be stable, but not passive. Loops that are tuned for
three times the true mass exceed it. Loops for the true mass do not, in contact with a soft body."""
LATE = 1.5
"""Time between two measurements, in multiples of the usual time, that counts as an interruption."""
MOST_STRETCH = 2.0
"""Largest stretch of a coupling, in multiples of that at the greatest force of the drive."""
DRIVE_LATENCY = 1
"""Latency of a drive that closes the coupling itself, in periods of the drive. A force acts in the
period after the measurement."""
FREQUENCIES = 2000
"""Number of frequencies at which the condition of passivity is evaluated."""


@dataclass(frozen=True)
class CouplingParameters:
    """Virtual coupling, and the properties of the drive that limit it.

    Raises
    ------
    ValueError
        A value is negative or not finite, or the stiffness or the greatest force is 0.
    """

    stiffness: float
    """Stiffness K of the spring [N/m]."""
    damping: float = 0.0
    """Damping B of the damper [N s/m]."""
    bandwidth: float = 100.0
    """Bandwidth of the filter of first order for the measured velocity [Hz]."""
    max_force: float = math.inf
    """Greatest force of the drive [N]."""
    latency: int = 0
    """Number n of whole periods from a measurement to the force that is computed from it."""
    friction: float = 0.0
    """Viscous damping b of the moving part itself [N s/m]."""
    drive_period: float | None = None
    """Period of a drive that closes the coupling itself [s]; None if the host closes it."""
    at_hand: bool = True
    """Whether a hand holds the moving part, so that the coupling must be passive. A velocity loop
    must only be stable."""

    def __post_init__(self) -> None:
        for name in ("stiffness", "bandwidth", "max_force"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
        for name in ("damping", "latency", "friction"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be >= 0, got {getattr(self, name)}")

    def needed_friction(self, period: float) -> float:
        """Return the damping of the moving part that makes the coupling passive [N s/m].

        The coupling is then stable with every passive hand. The condition of Colgate and Schenkel
        (J. Robotic Systems 14, 1997) is evaluated for the discrete spring and damper with their
        filter and latency. Without a damper, the result is K T (n + 1/2).

        Parameters
        ----------
        period
            Period of the control loop [s]. It is T if the host closes the coupling. Otherwise, T is
            the period of the drive, and n is `DRIVE_LATENCY`.
        """
        period, latency = self._closed_with(period)
        # The supremum at zero frequency is a limit. The first frequency approaches it to 1e-6.
        angle = np.linspace(1e-3, math.pi, FREQUENCIES)
        delayed = np.exp(-1j * angle)
        decay = math.exp(-2.0 * math.pi * self.bandwidth * period)
        velocity = (1.0 - delayed) / period * (1.0 - decay) / (1.0 - decay * delayed)
        impedance = (self.stiffness + self.damping * velocity) * delayed**latency
        real = ((1.0 - delayed) * impedance).real
        return float(np.max(0.5 * period * real / (1.0 - np.cos(angle))))

    def largest_stiffness(self, period: float) -> float:
        """Return the largest stiffness with which this coupling is passive [N/m]; at least 0.

        The needed damping of the moving part is linear in the gains, but its maximum over the
        frequency is not. The limit is therefore found by bisection.
        """
        own, latency = self._closed_with(period)
        low, high = 0.0, 2.0 * self.friction / (own * (latency + 0.5))
        for _ in range(50):
            middle = 0.5 * (low + high)
            trial = replace(self, stiffness=max(middle, 1e-9))
            if trial.needed_friction(period) <= self.friction:
                low = middle
            else:
                high = middle
        return low

    def _closed_with(self, period: float) -> tuple[float, int]:
        """Return the period [s] with which the coupling is closed, and its latency in periods."""
        if self.drive_period is None:
            return period, self.latency
        return self.drive_period, DRIVE_LATENCY

    def energy(self, stretch: float) -> float:
        """Return the energy that the spring stores at a stretch [m], with its limited force [J]."""
        linear = min(abs(stretch), self.max_force / self.stiffness)
        return 0.5 * self.stiffness * linear**2 + (
            self.max_force * (abs(stretch) - linear) if abs(stretch) > linear else 0.0
        )

    def problem(self, period: float) -> str:
        """Return why the coupling is not passive, with the permitted values; empty if it is.

        `period` is the period of the control loop [s].
        """
        needed = self.needed_friction(period)
        if needed <= self.friction:
            return ""
        own, latency = self._closed_with(period)
        closed = f"{latency} periods of latency at {1.0 / own:g} Hz"
        if self.drive_period is not None:
            closed += " in the drive, which closes the coupling (drive_rate_hz),"
        return (
            f"{self.stiffness:g} N/m: expected at most {math.floor(self.largest_stiffness(period))}"
            f" N/m with a coupling damping of {self.damping:g} N s/m, {closed} and a friction of "
            f"the handle of {self.friction:g} N s/m, or a friction of at least {needed:.3g} N s/m"
        )


class VirtualCoupling:
    """Spring and damper between a proxy, whose velocity is commanded, and the moving part.

    The proxy moves with the moving part until `hold` is called.

    Parameters
    ----------
    parameters
        Gains of the coupling, and properties of the drive.
    longest_step
        Longest time for which the proxy moves between two measurements [s]. After a longer
        interruption of the loop, the proxy thus does not jump.

    Attributes
    ----------
    force
        Force of the moving part on the proxy [N], limited to the greatest force of the drive.
    proxy
        Position of the proxy [m].
    position
        Latest position of the moving part [m].
    speed
        Filtered velocity of the moving part [m/s].
    error
        Reason why the drive must stop, as text; empty if there is none.
    """

    def __init__(self, parameters: CouplingParameters, longest_step: float = math.inf) -> None:
        self.parameters = parameters
        self._longest_step = longest_step
        self._rate = 2.0 * math.pi * parameters.bandwidth
        self._forces: deque[float] = deque(maxlen=parameters.latency + 1)
        self._usual = math.nan
        """Usual time between two measurements [s]."""
        self._unsure = 0
        """Number of intervals for which the energy is not known, after an interruption."""
        self._time = math.nan
        self.proxy = self.position = math.nan
        self.force = self.speed = self.velocity = 0.0
        self._holds = False
        self._generated = self._passed = 0.0
        self.error = ""

    def release(self) -> None:
        """Let the proxy move with the moving part, without force."""
        self._holds = False
        self.force = self.velocity = 0.0

    def hold(self) -> None:
        """Start at the present position, with the proxy at rest and without force."""
        if self._holds:
            return
        self._holds, self.proxy = True, self.position
        self.force = self.velocity = 0.0
        self._forces.clear()
        self._generated = self._passed = 0.0
        self.error = ""

    def measure(self, position: float, time: float) -> float:
        """Process the position of the moving part [m] at a time [s]; return the force [N]."""
        last, dt = self.position, time - self._time
        if dt <= 0.0:
            return self.force
        self.position, self._time = position, time
        if not dt < math.inf:  # the first measurement
            self.proxy = position
            return self.force
        moved = position - last
        self.speed += (moved / dt - self.speed) * -math.expm1(-self._rate * dt)
        if not self._holds:
            self.proxy = position
            return self.force
        p = self.parameters
        step = self.velocity * min(dt, self._longest_step)
        stretch = last - self.proxy
        self.proxy += step
        new = position - self.proxy
        if self._is_regular(dt):
            self._balance(moved, step, p.energy(new) - p.energy(stretch), dt)
        force = p.stiffness * new + p.damping * (self.speed - self.velocity)
        self.force = min(max(force, -p.max_force), p.max_force)
        self._forces.append(self.force)
        if not abs(new) * p.stiffness <= MOST_STRETCH * p.max_force:
            self._fail(
                f"the coupling is stretched by {new * 1e3:.1f} mm, at most "
                f"{MOST_STRETCH * p.max_force / p.stiffness * 1e3:.1f} mm: the hand pushes harder "
                "than the motor can, or the handle is released or blocked"
            )
        return self.force

    def _is_regular(self, dt: float) -> bool:
        """Return whether the force of the motor in this interval is known.

        During an interruption of the loop, the motor holds its last force. The next samples may
        also have inaccurate times, so that the intervals until the latency is over do not count.
        """
        usual = self._usual if self._usual == self._usual else dt
        late = dt > LATE * usual
        self._usual = usual + 0.02 * (dt - usual)
        self._unsure = self.parameters.latency + 2 if late else max(self._unsure - 1, 0)
        return not self._unsure

    def _balance(self, moved: float, step: float, stored: float, dt: float) -> None:
        """Update the energy that the coupling generates beyond what the moving part dissipates.

        The motor acts with the force of `latency` periods before. The generated energy is what the
        proxy receives and the spring stores, minus the work of the moving part.
        """
        p = self.parameters
        acting = self._forces[0] if len(self._forces) > p.latency else 0.0
        supplied = acting * moved
        keep = math.exp(-dt / WINDOW)
        self._generated *= keep
        self._passed *= keep
        dissipated = p.friction * moved * moved / dt
        self._generated += self.force * step + stored - supplied - dissipated
        self._passed += abs(supplied)
        most = GENERATED if p.at_hand else GENERATED_BY_LOOP
        if self._generated > NOTICEABLE and self._generated > most * self._passed:
            self._fail(
                "the coupling gives energy to the handle: expected a smaller stiffness of the "
                "coupling, or the true latency of the drive in the rig file"
                if p.at_hand
                else "the velocity loop oscillates: expected the true moving mass and latency"
            )

    def _fail(self, reason: str) -> None:
        self.error = self.error or reason


def velocity_loop(
    mass: float, friction: float, latency: int, period: float, max_force: float
) -> CouplingParameters:
    """Return a coupling with which a drive that accepts forces follows a velocity.

    The gains are those of a critically damped loop for the mass. Its bandwidth is half of the
    largest one that is stable with this latency and period.

    Parameters
    ----------
    mass
        Moving mass [kg].
    friction
        Viscous damping of the moving part [N s/m].
    latency
        Whole periods from a measurement to the force that is computed from it.
    period
        Period of the control loop [s].
    max_force
        Greatest force of the drive [N].
    """
    bandwidth = 0.5 * stable_bandwidth(latency, period)
    return loop_gains(mass, bandwidth, latency, period, friction, max_force)


def loop_gains(
    mass: float,
    bandwidth: float,
    latency: int,
    period: float,
    friction: float = 0.0,
    max_force: float = math.inf,
) -> CouplingParameters:
    """Return the gains of a critically damped velocity loop with this bandwidth [Hz]."""
    rate = 2.0 * math.pi * bandwidth
    return CouplingParameters(
        0.25 * mass * rate**2,
        mass * rate,
        0.25 / period,
        max_force,
        latency,
        friction,
        at_hand=False,
    )


@cache
def stable_bandwidth(latency: int, period: float) -> float:
    """Return the largest bandwidth with which a velocity loop of a free mass is stable [Hz]."""
    low, high = 0.0, 1.0 / period
    for _ in range(30):
        middle = 0.5 * (low + high)
        if is_stable(loop_gains(1.0, middle or 1.0, latency, period), period):
            low = middle
        else:
            high = middle
    return low


def is_stable(coupling: CouplingParameters, period: float, mass: float = 1.0) -> bool:
    """Return whether a mass on a coupling with a proxy at rest is stable without a hand.

    The motion of the mass under a force that is constant in each period is exact.
    """
    b = coupling.friction / mass
    decay = math.exp(-b * period)
    gain = -math.expm1(-b * period) / b if b else period
    travel = (period - gain) / b if b else 0.5 * period**2
    kept = math.exp(-2.0 * math.pi * coupling.bandwidth * period)
    n = coupling.latency
    # State: position, velocity, last position, filtered velocity, and the forces under way.
    size = 4 + n
    step = np.zeros((size, size))
    filtered = np.zeros(size)
    filtered[[0, 2, 3]] = (1.0 - kept) / period, -(1.0 - kept) / period, kept
    force = -coupling.damping * filtered
    force[0] -= coupling.stiffness
    acting = force if n == 0 else np.eye(size)[4]
    step[0] = gain * np.eye(size)[1] + travel / mass * acting
    step[0, 0] += 1.0
    step[1] = decay * np.eye(size)[1] + gain / mass * acting
    step[2, 0] = 1.0
    step[3] = filtered
    for i in range(n):
        step[4 + i] = force if i == n - 1 else np.eye(size)[5 + i]
    return bool(np.max(np.abs(np.linalg.eigvals(step))) < 1.0)
