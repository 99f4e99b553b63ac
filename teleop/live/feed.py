"""Interface between the server of the live page and the trial or recording on the page."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

from estimation.model import UNITS
from teleop.live.history import History
from teleop.safety.events import Fault, is_note

NAMES = (
    "time",
    "master_force",
    "master_position",
    "slave_position",
    "contact_force",
    "slave_velocity",
    "target",
    "phase",
    "drive_force",
    "x",
    "v",
    "f",
    "k_bound",
    "b_bound",
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
    "displayed_force",
    "model_stiffness",
    "report_age",
    "other_mode",
    "offset_low",
    "offset_high",
    "round_trip",
    "lost_datagrams",
    "overtaken_datagrams",
    "rejected_datagrams",
)
"""Columns of a tick that are sent to the live page, in addition to those of the estimators."""
PARTS = ("k", "b", "k_std", "b_std", "held", "misfit")
"""Ends of the names of the columns that are sent to the live page for every estimator."""
FURTHER = tuple(name for name in UNITS if name not in PARTS)
"""Parameters besides b and k, which are sent if the model of the estimator has them."""


def shown_columns(names: Sequence[str], estimators: Sequence[str]) -> list[str]:
    """Return those of the recorded columns that are sent to the live page, in their order."""
    of_estimators = [f"{name}_{part}" for name in estimators for part in (*PARTS, *FURTHER)]
    return [name for name in (*NAMES, *of_estimators) if name in set(names)]


def estimator_indices(names: Sequence[str], estimators: Sequence[str]) -> list[dict[str, Any]]:
    """Return the name of each estimator, and the places of its values in a row; None if not shown.

    `further` contains the places of the parameters besides b and k, by their names.
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


MARKED = ("active", "stopping", "fault")
"""Modes whose beginning the page marks in its plots."""
MOST_EVENTS = 100
"""Largest number of events of a trial that the page marks."""


def events_document(events: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the message `events`, with time, text and kind of the events that the page marks.

    An emergency stop is no fault: a person has stopped the trial.
    """
    no_faults = (None, "", Fault.EMERGENCY_STOP)
    marks = [
        {
            "time": event["time"],
            "text": event["text"],
            "fault": event.get("fault") not in no_faults,
        }
        for event in events
        if event.get("fault")
        or (event.get("mode") in MARKED and not is_note(None, event.get("source", "")))
    ]
    return {"type": "events", "events": marks[:MOST_EVENTS]}


class Feed(ABC):
    """Source of the data of the live page: a running trial or a recording."""

    history: History

    @abstractmethod
    def advance(self) -> list[dict[str, Any]]:
        """Add new rows to `history`, and return the new messages for all open pages."""

    @abstractmethod
    def documents(self) -> list[dict[str, Any]]:
        """Return the messages that a newly opened page needs, such as `welcome` and `trial`."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Return the fields of the message `state`; the server adds `clients` and `unlocked`."""

    @abstractmethod
    def request(self, request: dict[str, Any]) -> None:
        """Carry out a request; raise BadRequest if it is not possible here or now.

        The server has checked that the page may make it. Every page may request `stop`.
        """

    @abstractmethod
    def beat(self, seen: float) -> None:
        """Process a heartbeat of the page in control, which has the frame sent at `seen` [s]."""

    @abstractmethod
    def lost(self) -> None:
        """Process that the page in control has released it, is disconnected or is silent."""
