"""Energy tank: a store of energy that limits how much energy a change of a model can add.

The model is the model of the environment that the hand feels. The energy that the damping of the
admittance dissipates fills the tank. If a change of the model increases the energy that the model
stores, the same energy is taken from the tank. The increase is therefore limited to the energy in
the tank. The energy that the hand extracts is then never larger than the sum of two energies: the
energy that the hand has put in, and the initial energy of the tank.

Source: F. Ferraguti, C. Secchi, C. Fantuzzi, "A tank-based approach to impedance control with
variable stiffness", ICRA 2013.
"""

from __future__ import annotations

TANK_START = 5e-3
"""Energy in the tank at the start [J]."""
TANK_MAX = 50e-3
"""Largest energy in the tank [J]. Any further energy is not stored."""


class EnergyTank:
    """Virtual store of energy, which limits the energy that changes of a model can add.

    The model is the model of the environment that the hand feels.

    `start` is the energy at the start [J], and `capacity` the largest energy [J].
    """

    def __init__(self, start: float = TANK_START, capacity: float = TANK_MAX) -> None:
        if not 0.0 <= start <= capacity:
            raise ValueError(f"start of the tank must be 0 to {capacity:g} J, got {start:g} J")
        self._capacity = capacity
        self.energy = start
        """Energy in the tank [J]."""

    def fill(self, energy: float) -> None:
        """Add energy to the tank, up to its capacity."""
        energy += self.energy
        self.energy = energy if energy < self._capacity else self._capacity

    def affordable(self, cost: float) -> float:
        """Return the largest fraction of a model change for which the tank has enough energy."""
        return 1.0 if cost <= self.energy else self.energy / cost

    def pay(self, cost: float) -> None:
        """Take from the tank the energy that a change of the model needs.

        A negative cost changes nothing.
        """
        if cost > self.energy * (1.0 + 1e-9) + 1e-15:
            raise ValueError(f"a tank with {self.energy:g} J cannot pay {cost:g} J")
        self.energy = max(self.energy - max(cost, 0.0), 0.0)
