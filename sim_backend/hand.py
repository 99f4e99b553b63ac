"""The hand on the handle of the simulated rig."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_backend.plant import Handle, Intention


class Hand(ABC):
    """Base class of whatever moves the handle of the simulated rig.

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
        """Feel the position of the handle [m] and the force on it [N] at t [s] in the trial.

        Most hands do not react.
        """
