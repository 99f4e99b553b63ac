"""Source of data for the live page (a web page) that replays a recording.

A person can move to any time of the recording, and change the speed of the replay.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from estimation.arrays import Floats
from teleop.live.feed import QUANTITIES, Feed, estimator_indices, shown_columns
from teleop.live.history import SHOWN, History, decimated, decimation
from teleop.live.requests import BadRequest

POSITION_PERIOD = 0.1
"""Time between two messages with the position of the replay [s]."""
SHORTEST_PERIOD = 1e-6
"""Shortest period between two ticks of a recording [s]. Shorter periods are treated as this one."""
FASTEST = 16.0
"""Largest speed of a replay, as a multiple of real time."""


class Replay(Feed):
    """Source of data for the live page, which replays a recording.

    The live page is a web page that shows a running trial or a recording.

    Parameters
    ----------
    columns
        Columns of the recording by name, each of shape (n,), for n > 0 ticks (periods of the loop).
    descriptions
        Descriptions of columns, as dictionaries with the keys `name`, `unit` and `meaning`. A
        column without a description is shown, too.
    estimators
        Names of the estimators.
    events
        Events of the recorded trial (changes of mode, and faults), as dictionaries.
    trial
        The message `trial` to the page, which describes the recorded trial. If it is empty, no such
        message is sent.
    now
        Function that returns the present time [s].
    """

    def __init__(
        self,
        columns: Mapping[str, Floats],
        descriptions: Sequence[Mapping[str, str]],
        estimators: Sequence[str],
        events: Sequence[Mapping[str, Any]],
        trial: dict[str, Any],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        names = shown_columns(tuple(columns), estimators)
        known = {one["name"]: dict(one) for one in descriptions}
        self.history = History(len(names))
        self._rows = np.column_stack([columns[name] for name in names])
        self._t = np.maximum.accumulate(columns["time"])
        # The rate is computed from the times, because the settings in a file may be wrong.
        period = float(np.median(np.diff(self._t))) if len(self._t) > 1 else 1.0
        self._step = decimation(1.0 / max(period, SHORTEST_PERIOD))
        self._events = events
        armed = [event["time"] for event in events if event.get("mode") == "active"]
        self._armed_at = float(armed[0]) if armed else 0.0
        self._now = now
        self._due = -math.inf
        self._told: object = None
        self._seeks = 0
        self._welcome = {
            "type": "welcome",
            "version": 1,
            "quantities": QUANTITIES,
            "kind": "replay",
            "columns": [
                known.get(name, {"name": name, "unit": "-", "meaning": ""}) for name in names
            ],
            "estimators": estimator_indices(names, estimators),
            "may_arm": False,
            "pointer": False,
            "choices": {"condition": [], "specimen": [], "duration": []},
        }
        self._trial = trial
        self._rate = 1.0
        self._at = self._from = float(self._t[0])
        self._since = now()
        self._next = 0

    @property
    def end(self) -> float:
        """Time of the last tick of the recording [s]."""
        return float(self._t[-1])

    def advance(self) -> list[dict[str, Any]]:
        """Add the rows up to the present time of the replay to `history`; return the new messages.

        The list of messages contains at most one message, `replay`, which states time and speed of
        the replay. The message is due once per `POSITION_PERIOD`, and after a person has changed
        time or speed.
        """
        now = self._now()
        if self._rate:
            self._at = min(self._from + (now - self._since) * self._rate, self.end)
        end = int(np.searchsorted(self._t, self._at, side="right"))
        if end > self._next:
            self._add(self._next, end)
        if self._rate and self._at >= self.end:
            self._play(0.0)
        position = self._position()
        if now < self._due and (self._rate, self._seeks) == self._told:
            return []
        self._due, self._told = now + POSITION_PERIOD, (self._rate, self._seeks)
        return [position]

    def documents(self) -> list[dict[str, Any]]:
        """Return the messages that a newly opened live page needs.

        `welcome` describes the columns of the data, `trial` describes the recorded trial, and
        `replay` contains time and speed of the replay. If there is no message `trial`, it is left
        out.
        """
        return [self._welcome, *filter(None, [self._trial]), self._position()]

    def state(self) -> dict[str, Any]:
        """Return the fields of the message `state` to the live page.

        The field `text` describes the latest fault before the time that the page shows. It is empty
        if there is no fault before this time.
        """
        faults = [e for e in self._events if e.get("fault") and e["time"] <= self._at]
        text = str(faults[-1]["text"]) if faults else ""
        return {
            "mode": "replay",
            "text": text,
            "armed_by": None,
            "armed_at": self._armed_at,
            "loop": "running",
        }

    def request(self, request: dict[str, Any]) -> None:
        """Carry out a request of the live page to change the time or the speed of the replay.

        Raises
        ------
        BadRequest
            The request is possible only during a running trial, or a value is out of its range.
        """
        if request["type"] == "seek":
            self._seek(float(request["t"]))
        elif request["type"] == "play":
            rate = float(request["rate"])
            if not 0.0 <= rate <= FASTEST:
                raise BadRequest(f"play: expected a rate from 0 to {FASTEST:g}")
            if rate and self._at >= self.end:
                self._seek(float(self._t[0]))
            self._play(rate)
        else:
            raise BadRequest(f"{request['type']}: this is a recording")

    def beat(self, seen: float) -> None:
        """Do nothing: a heartbeat of the live page has no effect on a replay."""

    def lost(self) -> None:
        """Do nothing: the replay continues if the live page that had control has lost it."""

    def _position(self) -> dict[str, Any]:
        return {
            "type": "replay",
            "t": self._at,
            "start": float(self._t[0]),
            "end": self.end,
            "playing": self._rate > 0.0,
            "rate": self._rate,
        }

    def _play(self, rate: float) -> None:
        self._from, self._since, self._rate = self._at, self._now(), rate

    def _seek(self, t: float) -> None:
        """Continue the replay at time t [s] of the recording.

        The live page then shows the data of the `SHOWN` seconds before t. If t is before the start
        of the recording, the start is used; if t is after the end, the end is used.

        Raises
        ------
        BadRequest
            t is not finite.
        """
        if not math.isfinite(t):
            raise BadRequest("seek: expected a time")
        self._at = min(max(t, float(self._t[0])), self.end)
        self._seeks += 1
        self._play(self._rate)
        end = int(np.searchsorted(self._t, self._at, side="right"))
        self.history.clear()
        self._add(int(np.searchsorted(self._t, self._at - SHOWN)), end)

    def _add(self, start: int, end: int) -> None:
        """Add rows to `history`, whose rows are sent to the live page.

        The rows are ticks of the recording with indices from `start` up to but not including `end`.
        Only every `_step`-th tick is added, because the page needs fewer rows than the loop had
        ticks.
        """
        ticks = decimated(start, end, start - 1, self._step)
        self.history.add(self._rows[ticks])
        self._next = ticks[-1] + 1 if ticks else start
