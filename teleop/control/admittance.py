"""From force to velocity: the virtual dynamics of the master, and its coupling to the slave."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers import Command


@dataclass(frozen=True)
class AdmittanceParameters:
    """Virtual dynamics m x'' + d x' + c x = force that the master shows to the hand.

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
    """Virtual stiffness c that centres the handle [N/m]; 0 for none."""

    def __post_init__(self) -> None:
        for name in ("mass", "damping"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"virtual {name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.stiffness < math.inf:
            raise ValueError(f"centring stiffness must be >= 0, got {self.stiffness}")

    def force(self, position: float, velocity: float, acceleration: float) -> float:
        """Force [N] that moves the virtual mass so."""
        return self.mass * acceleration + self.damping * velocity + self.stiffness * position


class Admittance:
    """The virtual dynamics, discretised exactly for a force that is held over each period.

    Attributes
    ----------
    position
        Position of the virtual mass [m].
    velocity
        Its velocity [m/s].
    centre
        Where the virtual stiffness exerts no force [m].
    """

    def __init__(self, parameters: AdmittanceParameters) -> None:
        self.parameters = parameters
        self.position = 0.0
        self.velocity = 0.0
        self.centre = 0.0

    def align(self, slave_position: float, coupling: Coupling) -> None:
        """Put the virtual mass at rest where the coupling has nothing to correct.

        Called when the drives are armed, for the first time or again: without a force on the
        handle the command is then zero, wherever the slave is.

        Parameters
        ----------
        slave_position
            Position of the slave [m].
        coupling
            From the position of the virtual mass to that of the slave.
        """
        self.position = self.centre = slave_position / coupling.scale
        self.velocity = 0.0

    def step(self, force: float, dt: float) -> float:
        """Let the force [N] act for dt [s]; returns the velocity [m/s] after it.

        With s = d / 2m and g^2 = s^2 - c/m, the matrix exponential of the homogeneous
        equation is e^(-s dt) (cosh(g dt) I + sinh(g dt) / g (A + s I)), and turns into
        cosine and sine where g^2 < 0. `even` and `odd` are its two factors, decay included.
        """
        m, d, c = self.parameters.mass, self.parameters.damping, self.parameters.stiffness
        if c == 0.0:
            slip = self.velocity - force / d
            left = slip * math.exp(-d / m * dt)
            self.position += force / d * dt + (slip - left) * m / d
            self.velocity = force / d + left
            return self.velocity
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
        rest = self.centre + force / c
        offset, velocity = self.position - rest, self.velocity
        self.position = rest + (even + odd * s) * offset + odd * velocity
        self.velocity = (even - odd * s) * velocity - odd * c / m * offset
        return self.velocity

    def follow(self, velocity: float, dt: float) -> None:
        """Take note that the handle was moved at this velocity [m/s] over dt [s] instead."""
        self.position += (velocity - self.velocity) * dt
        self.velocity = velocity


class Coupling:
    """Slave velocity from the master's motion, scaled.

    v_s = scale v_m + gain (scale x_m - x_s). With gain zero, velocity alone is scaled, as in
    the paper; with a gain the slave keeps to the scaled position as well.

    Parameters
    ----------
    scale
        Slave motion for a unit of master motion, > 0.
    position_gain
        Rate [1/s] at which the slave makes up for a difference in position, >= 0.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    def __init__(self, scale: float = 1.0, position_gain: float = 0.0) -> None:
        if not 0.0 < scale < math.inf:
            raise ValueError(f"motion scale must be positive, got {scale}")
        if not 0.0 <= position_gain < math.inf:
            raise ValueError(f"position gain must be >= 0, got {position_gain}")
        self.scale = scale
        self.position_gain = position_gain

    def command(self, master: Admittance, slave_position: float) -> Command:
        """Velocities for both drives."""
        lag = self.scale * master.position - slave_position
        return Command(master.velocity, self.scale * master.velocity + self.position_gain * lag)
