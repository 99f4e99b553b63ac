"""The hand on the handle of the simulated rig."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_backend.plant import Handle, Intention


class Hand(ABC):
    """Base class of hands (operator or pointer) that move the handle of the simulated rig.

    Attributes
    ----------
    handle
        The handle of the simulated rig; None before the rig is created.
    """

    handle: Handle | None = None

    @abstractmethod
    def intention(self, t: float) -> Intention | None:
        """Return the intended motion at t [s] after the drives were enabled.

        None if the hand does not hold the handle. t increases from one call to the next, except
        when the drives are enabled again.
        """

    def feel(self, t: float, position: float, force: float) -> None:  # noqa: B027
        """Process the handle position [m] and the force [N] that the hand feels at t [s].

        t is the time since the drives were enabled. Most hands do not react.
        """
