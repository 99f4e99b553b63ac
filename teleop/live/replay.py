"""Source of data for the live page that replays a recording."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from estimation.arrays import Floats
from teleop.live.feed import Feed, estimator_indices, events_document, shown_columns
from teleop.live.history import History, decimated, decimation
from teleop.live.requests import BadRequest
from teleop.live.trust import JUDGED, Trust

POSITION_PERIOD = 0.1
"""Time between two messages with the position of the replay [s]."""
SHORTEST_PERIOD = 1e-6
"""Shortest period between two ticks of a recording [s]. Shorter periods are treated as this one."""
FASTEST = 16.0
"""Largest speed of a replay, as a multiple of real time."""
MOST_REPLAYED = 32_000
"""Largest number of rows of a recording that the page receives. The page can store 32768 rows."""


class Replay(Feed):
    """Source of data that replays a recording, at any time and speed that a person chooses.

    The page receives all rows at once, and shows those up to the present time of the replay. The
    present time is kept here, so that all pages show the same time.

    `columns` has the columns of the recording by name, shape (n,), n > 0. `descriptions` have the
    keys `name`, `unit` and `meaning`; a column without a description is shown, too. `trial` is the
    message that describes the recorded trial; if it is empty, it is not sent.
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
        t = np.maximum.accumulate(columns["time"])
        # The rate is computed from the times, because the settings in a file may be wrong.
        period = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
        step = max(
            decimation(1.0 / max(period, SHORTEST_PERIOD)), math.ceil(len(t) / MOST_REPLAYED)
        )
        ticks = decimated(0, len(t), -1, step)
        values = {**columns, "time": t}
        self._rows = np.column_stack([values[name][ticks] for name in names])
        self._t = t[ticks]
        self.history = History(len(names), len(ticks))
        self.history.add(self._rows)
        self._events = events
        armed = [event["time"] for event in events if event.get("mode") == "active"]
        self._armed_at = float(armed[0]) if armed else 0.0
        self._now = now
        self._due = -math.inf
        self._told: object = None
        self._seeks = 0
        self._news: deque[dict[str, Any]] = deque()
        self._documents = [
            {
                "type": "welcome",
                "version": 1,
                "kind": "replay",
                "columns": [
                    known.get(name, {"name": name, "unit": "-", "meaning": ""}) for name in names
                ],
                "estimators": estimator_indices(names, estimators),
                "may_arm": False,
                "pointer": False,
                "choices": {},
            },
            *filter(None, [trial]),
            events_document(events),
        ]
        self._trust = Trust(
            names, estimators, trial.get("transmission"), trial.get("removed_lost_motion", 0.0)
        )
        self._rate = 1.0
        self._at = self._from = float(self._t[0])
        self._since = now()

    @property
    def end(self) -> float:
        """Time of the last tick of the recording [s]."""
        return float(self._t[-1])

    def publish(self, document: dict[str, Any]) -> None:
        """Send a message to all pages, now and when they open. Any thread may call this method."""
        self._news.append(document)

    def advance(self) -> list[dict[str, Any]]:
        """Advance the time of the replay, and return the new messages.

        The message `replay` is due once per `POSITION_PERIOD`, and after a person has changed time
        or speed.
        """
        now = self._now()
        news = [self._news.popleft() for _ in range(len(self._news))]
        self._documents += news
        if self._rate:
            self._at = min(self._from + (now - self._since) * self._rate, self.end)
        if self._rate and self._at >= self.end:
            self._play(0.0)
        if now < self._due and (self._rate, self._seeks) == self._told:
            return news
        self._due, self._told = now + POSITION_PERIOD, (self._rate, self._seeks)
        shown = int(np.searchsorted(self._t, self._at, side="right"))
        self._trust.update(self._rows[max(shown - JUDGED, 0) : shown])
        return [*news, self._position()]

    def documents(self) -> list[dict[str, Any]]:
        """Return `welcome`, `trial` (if any), `events`, what was published, and `replay`."""
        return [*self._documents, self._position()]

    def state(self) -> dict[str, Any]:
        """Return the fields of `state`; `text` is the latest fault before the shown time."""
        faults = [e for e in self._events if e.get("fault") and e["time"] <= self._at]
        text = str(faults[-1]["text"]) if faults else ""
        return {
            "mode": "replay",
            "text": text,
            "armed_by": None,
            "armed_at": self._armed_at,
            "loop": "running",
            "trust": self._trust.document,
        }

    def request(self, request: dict[str, Any]) -> None:
        """Change the time or the speed of the replay."""
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
        """Continue the replay at time t [s], limited to the recording."""
        if not math.isfinite(t):
            raise BadRequest("seek: expected a time")
        self._at = min(max(t, float(self._t[0])), self.end)
        self._seeks += 1
        self._play(self._rate)
