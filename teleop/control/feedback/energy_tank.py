"""Energy tank, which limits how much energy a change of the displayed model can add to the model.

The energy that the damping of the admittance dissipates fills the tank. A change of the model may
add at most the energy in the tank to the energy that the model stores. The energy that the hand
extracts is therefore never larger than the sum of two energies: the energy that the hand has put
in, and the initial energy of the tank.

Source: F. Ferraguti, C. Secchi, C. Fantuzzi, "A tank-based approach to impedance control with
variable stiffness", ICRA 2013.
"""

from __future__ import annotations

TANK_START = 5e-3
"""Energy in the tank at the start [J]."""
TANK_MAX = 50e-3
"""Largest energy in the tank [J]. Any further energy is not stored."""


class EnergyTank:
    """Virtual store of energy with a limited capacity.

    Parameters
    ----------
    start, capacity
        Energy in the tank at the start [J], and largest energy in the tank [J].

    Raises
    ------
    ValueError
        `start` is negative, or larger than `capacity`.
    """

    def __init__(self, start: float = TANK_START, capacity: float = TANK_MAX) -> None:
        if not 0.0 <= start <= capacity:
            raise ValueError(f"start of the tank must be 0 to {capacity:g} J, got {start:g} J")
        self._capacity = capacity
        self.energy = start
        """Energy in the tank [J]."""

    def fill(self, energy: float) -> None:
        """Add dissipated energy [J], >= 0. Energy above the capacity is not stored."""
        energy += self.energy
        self.energy = energy if energy < self._capacity else self._capacity

    def affordable(self, cost: float) -> float:
        """Return the largest fraction of a change, 0 to 1, that the energy in the tank permits.

        `cost` is the energy that the whole change needs [J].
        """
        return 1.0 if cost <= self.energy else self.energy / cost

    def pay(self, cost: float) -> None:
        """Subtract the energy [J] that a change needs. A negative `cost` does not fill the tank.

        Raises
        ------
        ValueError
            `cost` is larger than the energy in the tank, by more than rounding errors.
        """
        if cost > self.energy * (1.0 + 1e-9) + 1e-15:
            raise ValueError(f"a tank with {self.energy:g} J cannot pay {cost:g} J")
        self.energy = max(self.energy - max(cost, 0.0), 0.0)
