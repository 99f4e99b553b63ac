"""The admittance, a virtual mass that converts a force to a velocity of the master."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

NEGLIGIBLE = 1e-12
"""A virtual stiffness below `NEGLIGIBLE` times mass / dt^2 is treated as 0, because the computed
rest position would be too far away."""


class Environment(NamedTuple):
    """Model of an environment, with the force b v + k x + k3 x^3 and the contact point x = 0."""

    k: float
    """Stiffness [N/m], >= 0."""
    k3: float = 0.0
    """Stiffening coefficient [N/m^3], >= 0."""
    b: float = 0.0
    """Damping [N s/m], >= 0."""
    glued: bool = True
    """Whether the body is glued, so that it also pulls at x < 0. If not, its force at x < 0 is
    zero."""

    def force(self, x: float, v: float) -> float:
        """Return the force [N] at position x [m] and velocity v [m/s]."""
        k, k3, b, glued = self
        if x < 0.0 and not glued:
            return 0.0
        force = b * v + (k + k3 * x * x) * x
        return force if glued else max(force, 0.0)

    def energy(self, x: float) -> float:
        """Return the elastic energy [J] at position x [m]."""
        square = x * x if x > 0.0 or self.glued else 0.0
        return (0.5 * self.k + 0.25 * self.k3 * square) * square


@dataclass(frozen=True)
class AdmittanceParameters:
    """Mass, damping and stiffness of the virtual dynamics of the master.

    The dynamics are m x'' + d x' + c x = force. x is the position of the master, relative to the
    position at which the spring force is zero.

    Raises
    ------
    ValueError
        Mass or damping is not positive, or the stiffness is negative.
    """

    mass: float = 0.5
    """Virtual mass m [kg]."""
    damping: float = 15.0
    """Virtual damping d [N s/m]."""
    stiffness: float = 0.0
    """Stiffness c of a virtual spring that pulls the handle to a centre [N/m]; 0 for no spring."""

    def __post_init__(self) -> None:
        for name in ("mass", "damping"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"virtual {name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.stiffness < math.inf:
            raise ValueError(f"centring stiffness must be >= 0, got {self.stiffness}")

    def force(self, position: float, velocity: float, acceleration: float) -> float:
        """Return the force [N] that the virtual mass needs for a given motion.

        Parameters
        ----------
        position, velocity, acceleration
            Position [m], velocity [m/s] and acceleration [m/s^2] of the master.
        """
        return self.mass * acceleration + self.damping * velocity + self.stiffness * position


class Admittance:
    """Virtual mass that moves under a force, with damping and an optional spring.

    The equation of motion is discretised exactly for a force that is constant over each period.

    Parameters
    ----------
    parameters
        Mass, damping and stiffness.

    Attributes
    ----------
    position
        Position of the virtual mass [m].
    velocity
        Velocity of the virtual mass [m/s].
    centre
        Position at which the force of the virtual spring is zero [m].
    """

    def __init__(self, parameters: AdmittanceParameters) -> None:
        self.parameters = parameters
        self._mass, self._damping = parameters.mass, parameters.damping
        self._stiffness = parameters.stiffness
        self.position = 0.0
        self.velocity = 0.0
        self.centre = 0.0

    def align(self, position: float) -> None:
        """Put the virtual mass at rest at a position [m], which is also the new `centre`."""
        self.position = self.centre = position
        self.velocity = 0.0

    def step(self, force: float, dt: float) -> float:
        """Apply a constant force [N] for dt [s], and return the velocity at the end [m/s].

        Let m, d and c be the mass, damping and stiffness of the virtual dynamics. Let A be the
        matrix of the state equation for (position, velocity), I the identity matrix,
        s = d / (2 m) and g^2 = s^2 - c / m. Then the matrix exponential of A dt is
        e^(-s dt) (cosh(g dt) I + sinh(g dt) / g (A + s I)). If g^2 < 0, cosh and sinh become cos
        and sin. In the code, `even` is e^(-s dt) cosh(g dt) and `odd` is e^(-s dt) sinh(g dt) / g.
        """
        d, c = self._damping, self._stiffness
        if c == 0.0:
            return self._slide(force, d, dt)
        return self._swing(self.centre + force / c, d, c, dt)

    def step_against(self, force: float, environment: Environment, dt: float) -> float:
        """Apply a constant force [N] for dt [s] against a body, and return the velocity [m/s].

        The virtual mass has the mass m, the damping d and the stiffness c. The body has the
        parameters k, k3 and b. The equation of motion is

            m v' + (d + b) v + c (x - centre) + k x + k3 x^3 = force

        The cubic term is linearised about the position X at the start of the period: k3 x^3 is
        about 3 k3 X^2 x - 2 k3 X^3. The linear equation is then solved exactly, as in `step`. A
        body that is not glued has no effect if X < 0.

        If x increases, the linearised force is smaller than k3 x^3. The work of the hand is then
        smaller than the energy that the cubic term stores. The difference is about k3 X (v dt)^2
        per unit of travel. The damping d dissipates more energy than this difference if
        v < d / (k3 X dt^2).
        """
        d, c, x = self._damping, self._stiffness, self.position
        k, k3, b, glued = environment
        if x < 0.0 and not glued:
            return self.step(force, dt)
        damping, stiffness = d + b, c + (k + 3.0 * k3 * x * x)
        if stiffness * dt * dt < NEGLIGIBLE * self._mass:
            return self._slide(force, damping, dt)
        constant = force + c * self.centre + 2.0 * k3 * x * x * x
        return self._swing(constant / stiffness, damping, stiffness, dt)

    def _slide(self, force: float, d: float, dt: float) -> float:
        """Solve m v' + d v = force over dt [s]; return the velocity at the end [m/s]."""
        m = self._mass
        slip = self.velocity - force / d
        left = slip * math.exp(-d / m * dt)
        self.position += force / d * dt + (slip - left) * m / d
        self.velocity = force / d + left
        return self.velocity

    def _swing(self, rest: float, d: float, c: float, dt: float) -> float:
        """Solve m v' + d v + c (x - rest) = 0 over dt [s]; return the velocity at the end [m/s]."""
        m = self._mass
        s = 0.5 * d / m
        square = s * s - c / m
        g = math.sqrt(abs(square))
        if g * dt < 1e-9:
            even = math.exp(-s * dt)
            odd = dt * even
        elif square > 0.0:
            slow, fast = math.exp((g - s) * dt), math.exp(-(g + s) * dt)
            even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / g
        else:
            decay = math.exp(-s * dt)
            even, odd = decay * math.cos(g * dt), decay * math.sin(g * dt) / g
        offset, velocity = self.position - rest, self.velocity
        self.position = rest + (even + odd * s) * offset + odd * velocity
        self.velocity = (even - odd * s) * velocity - odd * c / m * offset
        return self.velocity

    def follow(self, velocity: float, dt: float) -> None:
        """Replace the motion of the last step by a motion at a given constant velocity.

        The controller calls this method when the supervisor has reduced the commanded velocity of
        the master. The virtual mass then moves like the handle.

        Parameters
        ----------
        velocity
            Velocity that the drive of the master applied [m/s].
        dt
            Duration of the last step [s].
        """
        self.position += (velocity - self.velocity) * dt
        self.velocity = velocity
