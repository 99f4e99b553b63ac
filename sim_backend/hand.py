"""Base class of simulated hands, which move the handle of the simulated rig."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_backend.plant import Handle, Intention


class Hand(ABC):
    """Base class of simulated hands, which move the handle of the simulated rig.

    The hand is that of a simulated operator, or it follows a pointer such as a mouse.

    Attributes
    ----------
    handle
        The handle of the simulated rig; None before the rig is created.
    """

    handle: Handle | None = None

    @abstractmethod
    def intention(self, t: float) -> Intention | None:
        """Return the intended motion of the hand at t [s] after the drives were enabled.

        The result is None if the hand does not hold the handle. t increases from one call to the
        next. When the drives are enabled again, t starts again at 0.
        """

    def feel(self, t: float, position: float, force: float) -> None:  # noqa: B027
        """Process the handle position [m] and the force [N] that the hand feels at t [s].

        t is the time since the drives were enabled. In this base class, the method does nothing. A
        subclass can override it, so that the intended motion depends on the felt force.
        """
