"""Simulated force-commanded master: a back-drivable motor that holds the handle.

Most haptic devices are of this kind. The hand moves the handle, its encoder measures the position,
and the rig commands the force of the motor through a virtual coupling (`drivers.coupling`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from drivers.axes import CoupledAxis
from drivers.coupling import CouplingParameters, VirtualCoupling
from drivers.device import ForceDrive

if TYPE_CHECKING:
    from sim_backend.plant import Arm, Intention

Parsed = TypeVar("Parsed")

STEPS = 4
"""Integration steps per millisecond. The fastest pole is that of a light handle in a stiff hand."""
LONGEST_STEP = 0.02
"""Longest time for which the proxy moves between two measurements [s]."""


@dataclass(frozen=True)
class ForceMaster:
    """A force-commanded master and its virtual coupling.

    Raises
    ------
    ValueError
        A value is out of range.
    """

    stiffness: float = 1000.0
    """Stiffness of the virtual coupling [N/m]."""
    damping: float = 0.0
    """Damping of the virtual coupling [N s/m]."""
    mass: float = 0.2
    """Moving mass of the handle [kg]."""
    friction: float = 2.0
    """Viscous damping of the handle [N s/m]."""
    latency: int = 1
    """Whole periods from a measurement to the force that is computed from it."""
    max_force: float = 20.0
    """Greatest force of the motor [N]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.mass < math.inf:
            raise ValueError(f"mass of the handle must be positive, got {self.mass}")
        if not 0 <= self.latency <= 20:
            raise ValueError(f"latency must be 0 to 20 periods, got {self.latency}")
        if not self.max_force < math.inf:
            raise ValueError(f"max_force must be finite, got {self.max_force}")
        _ = self.coupling

    @property
    def coupling(self) -> CouplingParameters:
        """Virtual coupling of the handle."""
        return CouplingParameters(
            self.stiffness,
            self.damping,
            max_force=self.max_force,
            latency=self.latency,
            friction=self.friction,
        )


def parse_values(what: str, kind: Callable[..., Parsed], text: str) -> Parsed:
    """Return a master or slave from a text such as `max_force=9,latency=2`, or `default`.

    Parameters
    ----------
    what
        Name of the object, for error messages.
    kind
        Class of the object, whose fields are numbers.
    text
        Values by the name of the field. The text `default` has no values.

    Raises
    ------
    ValueError
        A name is unknown or given twice, or a value is no number or out of range.
    """
    if text.strip() == "default":
        return kind()
    types = {field.name: int if field.name == "latency" else float for field in fields(kind)}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for part in text.split(","):
        name, equals, given = (piece.strip() for piece in part.partition("="))
        try:
            if not equals or name in values:
                raise ValueError
            values[name] = types[name](given)
        except (KeyError, ValueError):
            raise ValueError(
                f"{what} {text!r}: {part.strip()!r}: expected default, or values in SI units "
                f"such as max_force=12,latency=2, each once, with {', '.join(types)}"
            ) from None
    return kind(**values)


class FreeHandle:
    """Handle that a hand and a motor push: m x'' = f_hand + f_motor - b x'.

    The attributes `x` and `v` are the position [m] and the velocity [m/s], and `push` is the force
    of the motor [N].
    """

    def __init__(self, mass: float, friction: float) -> None:
        self._mass, self._friction = mass, friction
        self.x = self.v = 0.0
        self.push: float | None = 0.0

    def advance(self, u: float, dt: float, arm: Arm, intended: Intention | None) -> None:
        """Advance the motion by `dt` [s]; `u` has no effect, because the handle has no servo.

        The intended position of the hand changes linearly to that at the end of the step.
        """
        steps = max(1, math.ceil(dt * 1e3 * STEPS - 1e-6))
        h, mass = dt / steps, self._mass
        k, b = (arm.stiffness, self._friction + arm.damping) if intended else (0.0, self._friction)
        for i in range(steps):
            left = dt - (i + 0.5) * h
            force = self.push or 0.0
            if intended:
                position = intended.position - intended.velocity * left
                force += k * position + arm.damping * intended.velocity
            # The implicit midpoint rule is stable for every stiffness and step.
            rate = (force - k * (self.x + 0.5 * h * self.v) - b * self.v) / (
                mass + 0.5 * h * b + 0.25 * h * h * k
            )
            self.x += h * (self.v + 0.5 * h * rate)
            self.v += h * rate


class Pushed(Protocol):
    """Moving part that a motor pushes."""

    push: float | None
    """Force of the motor [N]; None if the motor has another control."""


class SimulatedMotor(ForceDrive):
    """Motor of a simulated axis, which acts with the latency of its electronics.

    Out of operation, `push` of the moving part is `idle_push`: 0, or None if a brake or a servo
    then holds the part.
    """

    def __init__(self, part: Pushed, latency: int, idle_push: float | None = 0.0) -> None:
        self._part, self._idle_push = part, idle_push
        self._forces = deque([0.0] * (latency + 1), maxlen=latency + 1)

    def enable(self) -> bool:
        """Return True: the motor is in operation without delay."""
        self._part.push = 0.0
        return True

    def command(self, force: float) -> float:
        """Send a force, which acts after the latency."""
        self._forces.append(force)
        if self._part.push is not None:
            self._part.push = self._forces[0]
        return force

    def idle(self) -> bool:
        """Take the motor out of operation at once."""
        self._forces.extend([0.0] * len(self._forces))
        self._part.push = self._idle_push
        return True


def make_axis(
    master: ForceMaster, handle: FreeHandle, max_velocity: float, rest_velocity: float
) -> CoupledAxis:
    """Return the axis of a simulated force-commanded master."""
    motor = SimulatedMotor(handle, master.latency)
    coupling = VirtualCoupling(master.coupling, LONGEST_STEP)
    return CoupledAxis(motor, 1, coupling, rest_velocity, max_velocity)
