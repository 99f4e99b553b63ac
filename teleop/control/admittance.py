"""Admittance of the master (the handle): a virtual mass converts a force to a velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

NEGLIGIBLE = 1e-12
"""A stiffness below `NEGLIGIBLE` times mass / dt^2 is treated as 0. The rest position, which is
force / stiffness, would otherwise be so far away that the rounding errors are large."""


class Environment(NamedTuple):
    """Model of an environment, which is a body that exerts the force b v + k x + k3 x^3.

    x is the displacement into the body, and v is its derivative. Contact begins at x = 0.
    """

    k: float
    """Stiffness [N/m], >= 0."""
    k3: float = 0.0
    """Coefficient k3 of the cubic term of the force [N/m^3], >= 0."""
    b: float = 0.0
    """Damping [N s/m], >= 0."""
    glued: bool = True
    """Whether the body is glued to the part that presses on it, so that the body also pulls. If
    not, the result of `force` is never negative, and it is zero at x < 0."""

    def force(self, x: float, v: float) -> float:
        """Return the force of the body [N] at displacement x [m] and velocity v [m/s]."""
        k, k3, b, glued = self
        if x < 0.0 and not glued:
            return 0.0
        force = b * v + (k + k3 * x * x) * x
        return force if glued else max(force, 0.0)

    def slope(self, x: float) -> float:
        """Return the derivative of the elastic force with respect to x [N/m]."""
        k, k3, _, glued = self
        return k + 3.0 * k3 * x * x if x >= 0.0 or glued else 0.0

    def energy(self, x: float) -> float:
        """Return the elastic energy that the body stores [J] at displacement x [m]."""
        square = x * x if x > 0.0 or self.glued else 0.0
        return (0.5 * self.k + 0.25 * self.k3 * square) * square


@dataclass(frozen=True)
class AdmittanceParameters:
    """Mass, damping and stiffness of the virtual dynamics of the master (the handle).

    The dynamics are m x'' + d x' + c x = force. x is the position of the master, relative to the
    centre. The centre is the position at which the force of the virtual spring is zero.

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
    """Stiffness c of a virtual spring that pulls the handle to the centre [N/m]; 0: no spring."""

    def __post_init__(self) -> None:
        for name in ("mass", "damping"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"virtual {name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.stiffness < math.inf:
            raise ValueError(f"centring stiffness must be >= 0, got {self.stiffness}")

    def force(self, position: float, velocity: float, acceleration: float) -> float:
        """Return the force [N] with which the virtual mass performs a given motion."""
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
        """Set the position of the virtual mass and the centre to `position` [m].

        The centre is the position at which the force of the virtual spring is zero. The velocity of
        the virtual mass becomes zero.
        """
        self.position = self.centre = position
        self.velocity = 0.0

    def step(self, force: float, dt: float) -> float:
        """Move the virtual mass for dt [s] under a constant force [N]; return the velocity [m/s].

        The returned velocity is the velocity at the end of the step. The equation of motion is
        solved exactly.
        """
        d, c = self._damping, self._stiffness
        if c == 0.0:
            return self._slide(force, d, dt)
        return self._swing(self.centre + force / c, d, c, dt)

    def step_against(self, force: float, environment: Environment, dt: float) -> float:
        """Move the virtual mass for dt [s] under a constant force, while it presses on a body.

        m, d and c are the mass, damping and stiffness of the virtual dynamics. k, k3 and b are the
        parameters of the body. The equation of motion is

            m v' + (d + b) v + c (x - centre) + k x + k3 x^3 = force

        The cubic term is linearised about the position X at the start of the step: k3 x^3 is
        replaced by 3 k3 X^2 x - 2 k3 X^3. The linear equation is then solved exactly.

        The linearisation generates energy. When x increases, the linearised force is smaller than
        k3 x^3, so that the hand does less work than the energy that the cubic term stores. The
        missing work is about k3 X (v dt)^2 per metre of travel. The damping d dissipates the energy
        d v per metre. This is more than the missing work if v < d / (k3 X dt^2). A body that is not
        glued has no effect if X < 0.
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
        """Move the virtual mass for dt [s], with m v' + d v = force; return v at the end [m/s]."""
        m = self._mass
        slip = self.velocity - force / d
        left = slip * math.exp(-d / m * dt)
        self.position += force / d * dt + (slip - left) * m / d
        self.velocity = force / d + left
        return self.velocity

    def _swing(self, rest: float, d: float, c: float, dt: float) -> float:
        """Move the virtual mass for dt [s], with m v' + d v + c (x - rest) = 0.

        The state (x - rest, v) at the start is multiplied by the matrix exponential

            exp(A dt) = even I + odd (A + s I)
            even = e^(-s dt) cosh(g dt)
            odd = e^(-s dt) sinh(g dt) / g

        A is the matrix of the state equation, and I is the identity matrix. s is d / (2 m), and g^2
        is s^2 - c / m. If g^2 is negative, g is sqrt(-g^2), and cosh and sinh are replaced by cos
        and sin.
        """
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
        """Correct the last step, so that the virtual mass moves like the handle.

        This method is called if a safety limit has reduced the velocity that `step` returned. The
        velocity is set to the given value, and the position is changed by the difference between
        the new and the old velocity times dt.
        """
        self.position += (velocity - self.velocity) * dt
        self.velocity = velocity
