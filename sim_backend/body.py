"""Base classes of the bodies (specimens) that the slave touches.

A `Law` computes the contact force from displacement and velocity at one instant. The law of a
`Body` can change with time, because it can depend on the deformation in the past.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any


class Law:
    """Contact force of a body at one instant, as a function of displacement x and velocity v.

        f = k1 x + k3 x^3 + b v - preload

    If the body is glued to the slave's plate, the equation is valid in compression and in tension.
    If not, the force is never negative, and it is zero while the slave is outside of the body.
    """

    k1: float
    """Stiffness at small displacement [N/m]."""
    k3: float
    """Stiffening coefficient [N/m^3]."""
    b: float
    """Damping [N s/m]."""
    glued: bool
    """Whether the body is glued to the slave's plate."""
    preload: float
    """Reduction of the present force, caused by the deformation in the past [N]."""

    @property
    def rest(self) -> float:
        """Displacement of the body's surface while the slave does not touch the body [m].

        The static force is zero at this displacement.
        """
        return root(self.k1, self.k3, self.preload) if self.preload else 0.0

    def surface(self, x: float) -> float:
        """Return the displacement of the body's surface [m] when the slave is at position x [m].

        The surface moves with the slave during contact. Without contact, it is at `rest`.
        """
        return x if self.glued else max(x, self.rest)

    def force(self, x: float, v: float) -> float:
        """Return the contact force [N] at displacement x [m] and velocity v [m/s]."""
        force = (self.k1 + self.k3 * x * x) * x + self.b * v - self.preload
        return force if self.glued or (force > 0.0 and x > self.rest) else 0.0

    def stiffness(self, x: float) -> float:
        """Return the derivative of the static force with respect to displacement [N/m], at x [m].

        The derivative is k1 + 3 k3 x^2. Without contact, the result is zero.
        """
        return self.k1 + 3.0 * self.k3 * x * x if self.glued or x > self.rest else 0.0

    def compressed(self, x: float, compliance: float) -> float:
        """Return the displacement y of the body [m] when a spring is in series with the body.

        y is the solution of x = y + c f(y, 0). The function f(y, 0) is the force of the body at
        displacement y and zero velocity.
        """
        if not (self.glued or x > self.rest):
            return x
        return root(1.0 + compliance * self.k1, compliance * self.k3, x + compliance * self.preload)


def root(linear: float, cubic: float, value: float) -> float:
    """Return the solution y of `linear * y + cubic * y**3 = value`; linear > 0 and cubic >= 0."""
    alone = value / linear
    r = 1.5 * alone * math.sqrt(3.0 * cubic / linear)
    return alone * 3.0 * math.sinh(math.asinh(r) / 3.0) / r if abs(r) > 1e-9 else alone


class Body(ABC):
    """Base class of bodies. The law of the contact force can depend on the deformation in the past.

    The law is the contact force as a function of displacement and velocity. The state of a body
    contains the data of the past on which the law depends. `initial` is the state before the first
    contact, and `advanced` returns the state after a time step. The simulation stores the state,
    but only the methods of the body use its content. The `Body` object itself never changes.
    Several simulations can therefore use the same object.
    """

    @property
    def initial(self) -> Any:
        """State of the body before the first contact.

        The state contains the data of the past on which the contact force depends. It is None if
        the contact force does not depend on the past.
        """
        return None

    @abstractmethod
    def law(self, state: Any) -> Law:
        """Return the contact force as a function of displacement and velocity.

        `state` contains the data of the past on which this function depends.
        """

    @abstractmethod
    def advanced(self, state: Any, surface: float, dt: float) -> Any:
        """Return the state of the body after the time `dt` [s].

        `state` is the state before this time. During this time, the surface of the body moves at
        constant velocity to the displacement `surface` [m].
        """

    @property
    @abstractmethod
    def glued(self) -> bool:
        """Whether the body is glued to the slave's plate."""

    @property
    @abstractmethod
    def slow(self) -> Law:
        """Contact force as a function of displacement and velocity, valid for slow motion.

        A motion is slow if it takes much more time than the relaxation times of the body. If the
        body becomes another body during the trial (`Changing`), this is the law before the change.
        """

    @property
    def fast(self) -> Law:
        """Contact force as a function of displacement and velocity, valid for fast motion.

        A motion is fast if it takes much less time than the relaxation times of the body. If the
        body becomes another body during the trial (`Changing`), this is the law before the change.
        """
        return self.law(self.initial)

    @property
    @abstractmethod
    def further_laws(self) -> dict[str, Law]:
        """All laws of the contact force except `slow`, by name.

        For example, `fast` is the law for fast motion, and `changed` is the law after the change of
        a `Changing` body.
        """
