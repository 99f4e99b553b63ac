"""Base class of hands that move the handle of the simulated rig."""

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

        The result is None if the hand does not hold the handle. t increases from one call to the
        next. When the drives are enabled again, t starts again at 0.
        """

    def feel(self, t: float, position: float, force: float) -> None:  # noqa: B027
        """Process the handle position [m] and the force [N] that the hand feels at t [s].

        t is the time since the drives were enabled. This class does nothing.
        """
