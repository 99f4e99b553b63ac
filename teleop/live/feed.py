"""Interface between the server of the live page and the trial or recording on the page."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from estimation.model import UNITS
from estimation.quantities import RESULTS, SIGNALS
from teleop.live.history import History

NAMES = (
    "time",
    "master_force",
    "master_position",
    "slave_position",
    "contact_force",
    "slave_velocity",
    "target",
    "drive_force",
    "x",
    "v",
    "f",
    "excitation",
    "contact",
    "mode",
    "limited",
    "lateness",
    "overrun",
    "skipped",
    "busy_time",
    "dropped",
    "pointer_depth",
    "pointer_grip",
)
"""Columns of a tick that are sent to the live page, in addition to those of the estimators."""
QUANTITIES = {
    symbol: {"unit": one.unit, "factor": one.factor, "decimals": one.decimals}
    for symbol, one in (RESULTS | SIGNALS).items()
}
"""How the page shows the quantities, by symbol."""
PARTS = ("k", "b", "k_std", "b_std", "held", "misfit")
"""Ends of the names of the columns that are sent to the live page for every estimator."""
FURTHER = tuple(name for name in UNITS if name not in PARTS)
"""Parameters besides b and k, which are sent if the model of the estimator has them."""


def shown_columns(names: Sequence[str], estimators: Sequence[str]) -> list[str]:
    """Return the names of the columns that are sent to the live page.

    The order of the names is the order of the values in a row of data.

    Parameters
    ----------
    names
        Names of all columns that the control loop writes.
    estimators
        Names of the estimators.
    """
    of_estimators = [f"{name}_{part}" for name in estimators for part in (*PARTS, *FURTHER)]
    return [name for name in (*NAMES, *of_estimators) if name in set(names)]


def estimator_indices(names: Sequence[str], estimators: Sequence[str]) -> list[dict[str, Any]]:
    """Return one dictionary for each estimator, with its name and the indices of its values.

    An index is the place of a value in a row of data; None if the row does not contain this value.
    The key `further` contains the indices of the parameters besides b and k, by their names.

    Parameters
    ----------
    names
        Names of the columns of a row.
    estimators
        Names of the estimators.
    """
    place = {name: i for i, name in enumerate(names)}
    return [
        {
            "name": name,
            **{part: place.get(f"{name}_{part}") for part in PARTS},
            "further": {p: place[f"{name}_{p}"] for p in FURTHER if f"{name}_{p}" in place},
        }
        for name in estimators
    ]


class Feed(ABC):
    """Source of the data of the live page: a running trial or a recording.

    Attributes
    ----------
    history
        The latest rows of data for the page.
    """

    history: History

    @abstractmethod
    def advance(self) -> list[dict[str, Any]]:
        """Add new rows of data to `history`, and return the new messages for all open pages.

        The server calls this method regularly, once per `teleop.live.server.PERIOD`.
        """

    @abstractmethod
    def documents(self) -> list[dict[str, Any]]:
        """Return the messages that a newly opened page needs, such as `welcome` and `trial`."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Return the fields of the message `state` that describe the trial or recording.

        The server adds the other fields, and sends the message to the page at regular times.
        """

    @abstractmethod
    def request(self, request: dict[str, Any]) -> None:
        """Carry out a request of an open page. The caller has checked that this page may make it.

        Every page may request `stop`.

        Parameters
        ----------
        request
            The fields of the request, by their names. The field `type` is the kind of the request.

        Raises
        ------
        BadRequest
            The request is not possible for this source of data, or not at this time.
        """

    @abstractmethod
    def beat(self, seen: float) -> None:
        """Process a heartbeat, which the page that has control sends at regular times.

        Parameters
        ----------
        seen
            Time at which the newest frame was sent that the page has received [s].
        """

    @abstractmethod
    def lost(self) -> None:
        """Process the event that the page that had control has lost control.

        The page has released control, is disconnected, or has sent no heartbeat for too long.
        """
