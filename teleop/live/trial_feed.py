"""Source of data for the live page: the trials that one control process runs."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimation.arrays import Floats
from teleop.live.cells import ARM, END, PROCESS, STOP, CellWriter
from teleop.live.feed import Feed, estimator_indices, events_document, shown_columns
from teleop.live.history import History, decimated, decimation
from teleop.live.requests import ANSWERS, BadRequest
from teleop.live.trust import JUDGED, Trust
from teleop.safety.events import ACTIVE, READY, Fault, Mode, is_note
from teleop.streams.stream import Batch, StreamReader

PATIENCE = 0.1
"""Longest time for which the page waits for the estimates of a tick [s]."""
RECENT = 1.0
"""Length of the time window [s]. The live page shows the largest lateness within this window."""
SILENCE = 0.5
"""Time without a new tick after which the page shows that the loop has ended [s]."""
DEEPEST = 0.1
"""Largest magnitude of the depth that the pointer of the live page can request [m]."""
SENT = {"name": "sent", "unit": "s", "meaning": "time at which the loop wrote the tick"}
"""Description of a column that is not recorded. It is the last column of each row for the page."""
STOPS = {"live page": "stopped with STOP in the page", "key": "stopped at the terminal"}
"""Description of an emergency stop by a person, by its source."""
MOST_TRIALS = 50
"""Largest number of trials in the list of trials of the page."""
TOLD = {"idle": "introduction", "ready": "introduction", "active": "instruction"}
"""Field of the message `trial` that is shown in a mode."""


class Health:
    """Counts overruns, skipped periods and dropped ticks of a trial."""

    def __init__(self) -> None:
        self._overruns = self._skipped = self._dropped = 0
        self._latenesses: deque[tuple[float, float]] = deque()

    def add(self, values: Floats, column: Mapping[str, int], now: float) -> None:
        """Add ticks, shape (n, columns), at the time `now` [s]; `column` has the indices."""
        self._overruns += int(values[:, column["overrun"]].sum())
        self._skipped += int(values[:, column["skipped"]].sum())
        self._dropped = int(values[-1, column["dropped"]])
        self._latenesses.append((now, float(np.max(values[:, column["lateness"]]))))

    def document(self, now: float) -> dict[str, Any]:
        """Return the counts, and the largest lateness in the last `RECENT` seconds [s]."""
        while self._latenesses and self._latenesses[0][0] < now - RECENT:
            self._latenesses.popleft()
        return {
            "overruns": self._overruns,
            "skipped": self._skipped,
            "dropped": self._dropped,
            "lateness_max": max((late for _, late in self._latenesses), default=None),
        }


class TrialFeed(Feed):
    """Source of data for the live page: the trials of one control process.

    `session` has fields of `welcome`: `may_arm` (whether the page may arm the drives), `pointer`
    (whether the mouse moves the handle) and `choices` (values that a setting may have). `send`
    sends a request to the control process, which reads requests between two trials. `offer` makes
    the files of a recording available to the pages, and returns their addresses by name.
    """

    def __init__(
        self,
        cells: CellWriter,
        session: dict[str, Any],
        send: Callable[[dict[str, Any]], None],
        offer: Callable[[Path], dict[str, str]],
    ) -> None:
        self.history = History(1)
        self._cells = cells
        self._stream: StreamReader | None = None
        self._session = session
        self._send = send
        self._offer = offer
        self._begin: dict[str, Any] = {}
        self._valid: dict[str, dict[str, Any]] = {}
        self._news: list[dict[str, Any]] = []
        self._sent = 0
        self._health = Health()
        self._armed_at: float | None = None
        self._step = 1
        self._indices: list[int] = []
        self._mode, self._running = Mode.IDLE, False
        self.gone = False
        """Whether the control process has ended, which the live page shows."""
        self._text = self._advice = ""
        self._grips = False
        """Whether the hand that follows the pointer holds the handle."""
        self._trials: list[dict[str, Any]] = []
        """Number, settings and result of the trials of the session."""
        self._prompt: dict[str, Any] | None = None
        """Number of the question that the control process asks, and its possible answers."""
        self._chosen: dict[str, Any] = {}
        """Settings that a person has chosen in the page since the latest trial began."""
        self._faults: list[str] = []
        self._by_person = False
        """Whether a person caused the first fault, with an emergency stop."""
        self._events_read: list[dict[str, Any]] = []
        """Events of the trial, with the texts that the page shows."""
        self._notes: dict[str, str] = {}
        """Latest note of each source, such as the precision of the result so far."""
        self._latest = 0.0
        self._column: dict[str, int] = {}
        self._trust = Trust([], [], None)
        self._describe([], [], 0.0)

    def receive(self, document: dict[str, Any]) -> None:
        """Process a message of the control process.

        The messages are `begin` or `end` of a trial, `evaluating` and then its `summary`, a
        `prompt`, and `refused`: a trial could not begin, or cannot have the settings that a person
        has chosen.
        """
        kind = document["type"]
        if kind == "begin":
            self._begin_trial(document)
        elif kind == "end":
            self.advance()
            self._running = False
            self._text = document["text"]
        elif kind == "refused":
            # the fault of the trial before is no longer the present state
            self._faults, self._by_person = [], False
            self._chosen = {}
        elif kind == "prompt":
            self._text, self._advice = document["text"], document["advice"]
            self._prompt = {name: document[name] for name in ("number", "answers")}
        elif kind == "summary":
            self._valid.pop("evaluating", None)
            self._publish({**document, "files": self._files(document)})
            self._list(document)
        else:
            self._publish(document)

    def _files(self, summary: Mapping[str, Any]) -> dict[str, str]:
        """Return the addresses of the files of a trial; none without a complete recording."""
        recording = summary["recording"]
        if not recording["path"] or recording["problem"]:
            return {}
        try:
            files = self._offer(Path(recording["path"]))
        except OSError:  # such as a full disk: the result is shown without files
            return {}
        if not summary["picture"]:  # without an evaluation, there is no report
            files.pop("report", None)
        return files

    def advance(self) -> list[dict[str, Any]]:
        """Send a heartbeat, and read new ticks and events; return the new messages to the page."""
        self._cells.count(PROCESS)
        while self._running and self._stream and (batch := self._stream.read()):
            self._read_ticks(batch)
            self._read_texts(batch)
        news, self._news = self._news, []
        return news

    def documents(self) -> list[dict[str, Any]]:
        """Return the latest message of each kind, such as `welcome`, `trial` and `summary`."""
        return list(self._valid.values())

    def state(self) -> dict[str, Any]:
        """Return the message `state`: mode, text for the operator, whether the loop runs."""
        silent = self._running and time.monotonic() - self._latest > SILENCE
        if not self._running:
            mode = "ended" if "trial" in self._valid else "idle"
        else:
            mode = "idle" if self._mode < READY else self._mode.name.lower()
        by_page = self._begin.get("by_page", False)
        texts = [*self._faults[:1], self._text]
        texts.append(self._valid.get("trial", {}).get(TOLD.get(mode, ""), ""))
        texts += self._notes.values()
        return {
            "mode": mode,
            "faulted": bool(self._faults),
            "by_person": self._by_person,
            "text": "; ".join(dict.fromkeys(filter(None, texts))),
            "advice": self._advice_in(mode, by_page),
            "prompt": self._prompt,
            "armed_by": ("page" if by_page else "terminal") if self._begin else None,
            "armed_at": self._armed_at,
            "loop": "gone" if self.gone or silent else "running",
            "health": self._health.document(time.monotonic()),
            "trust": self._trust.document,
        }

    def request(self, request: dict[str, Any]) -> None:
        """Pass a request to the control process, through shared memory or as a message."""
        kind, active = request["type"], self._running and self._mode >= ACTIVE
        if kind == "stop":
            self._cells.count(STOP)
        elif kind == "end":
            if not self._running:
                raise BadRequest("end: no trial is running")
            self._cells.count(END)
        elif kind == "start":
            self._start()
        elif kind == "pointer":
            if not self._session["pointer"]:
                raise BadRequest("pointer: expected teleop run --operator pointer")
            depth = min(max(float(request["depth"]), -DEEPEST), DEEPEST)
            self._grips = request["grip"]
            self._cells.point(depth, self._grips)
        elif kind == "choose":
            self._choose(request, active)
        elif kind in ANSWERS:
            self._answer(request)
        else:
            raise BadRequest(f"{kind}: this is not a recording")

    def beat(self, seen: float) -> None:
        """Pass a heartbeat of the live page that has control to the control loop."""
        self._cells.confirm(seen)

    def lost(self) -> None:
        """Report to the loop that the hand does not hold the handle, because no page has control.

        If the page has armed the drives, the loop stops the trial when it receives no heartbeats.
        """
        self._grips = False
        self._cells.point(0.0, False)

    def _start(self) -> None:
        if not (self._session["may_arm"] and self._begin.get("by_page")):
            raise BadRequest("start: expected teleop run --live-arm")
        if not self._running or self._mode is not READY:
            raise BadRequest("start: expected the mode ready")
        self._cells.count(ARM)

    def _answer(self, request: dict[str, Any]) -> None:
        if self._running:
            raise BadRequest(f"{request['type']}: a trial is running")
        if not self._prompt or request["prompt"] != self._prompt["number"]:
            raise BadRequest(f"{request['type']}: expected an answer to the present question")
        if request["type"] not in self._prompt["answers"]:
            expected = ", ".join(self._prompt["answers"])
            raise BadRequest(f"{request['type']}: expected one of {expected}")
        self._send(request)

    def _choose(self, request: dict[str, Any], active: bool) -> None:
        """Send the settings that a person has chosen in the page to the control process.

        If a trial waits for START, it is ended. The control process then begins a trial with the
        new settings.
        """
        choices = self._session["choices"]
        for name in request.keys() - {"type"}:
            chosen = request[name] if name == "estimators" else [request[name]]
            if not chosen or chosen != [one for one in choices[name] if one in chosen]:
                raise BadRequest(f"choose.{name}: expected one of {choices[name]}")
        if active:
            raise BadRequest("choose: a trial is running")
        self._send(request)
        self._chosen |= {name: value for name, value in request.items() if name != "type"}
        if self._running:
            self._cells.count(END)

    def _begin_trial(self, begin: dict[str, Any]) -> None:
        try:
            self._stream = StreamReader.open(begin["stream"], "live page")
        except OSError:  # the trial has ended before it was read
            return
        self._stream.patience = PATIENCE
        columns, estimators = self._stream.schema.columns, self._stream.schema.estimators
        names = [column.name for column in columns]
        self._begin = begin
        self._step = decimation(begin["rate"])
        self._sent, self._health, self._armed_at = 0, Health(), None
        self._column = {name: place for place, name in enumerate(names)}
        self._mode, self._running, self._faults, self._by_person = Mode.IDLE, True, [], False
        self._text = self._advice = ""
        self._notes = {}
        self._events_read = []
        self._prompt = None
        self._latest = time.monotonic()
        shown = shown_columns(names, estimators)
        self._indices = [self._column[name] for name in shown]
        trial = begin["trial"]
        self._trust = Trust(shown, estimators, trial["transmission"], trial["removed_lost_motion"])
        of = {column.name: column._asdict() for column in columns}
        for name in ("summary", "evaluating", "events"):
            self._valid.pop(name, None)
        self._describe([of[name] for name in shown], estimators, begin["rate"])
        self._news.append(self._valid["welcome"])
        self._publish(begin["trial"])
        choice, self._chosen = self._chosen, {}
        if any(begin["trial"]["choice"][name] != value for name, value in choice.items()):
            # The control process read the choice too late for this trial. It waits in the pipe, and
            # the trial that begins now ends, like every trial that waits for START at a choice.
            self._cells.count(END)
        epoch = self.history.epoch
        self.history = History(len(shown) + 1)
        self.history.epoch = epoch + 1

    def _describe(
        self, columns: list[dict[str, str]], estimators: Sequence[str], rate: float
    ) -> None:
        """Create the message `welcome`, which describes the data of a trial to the live page."""
        self._valid["welcome"] = {
            "type": "welcome",
            "version": 1,
            "kind": "live",
            "columns": [*columns, SENT] if columns else [],
            "estimators": estimator_indices([c["name"] for c in columns], estimators),
            "rate": rate,
            **self._session,
        }

    def _publish(self, document: dict[str, Any]) -> None:
        self._valid[document["type"]] = document
        self._news.append(document)

    def _list(self, summary: Mapping[str, Any]) -> None:
        """Add the present trial to the list of trials, with k and b of its result."""
        trial = self._valid["trial"]
        stopped = "stopped" if self._by_person else "ended by a fault"
        entry = {
            "number": self._trials[-1]["number"] + 1 if self._trials else 1,
            "condition": trial["condition"],
            "specimen": trial["specimen"],
            "feedback": trial["choice"]["feedback"],
            "stopped": stopped if self._faults else "",
            "values": summary["shown"]["values"],
        }
        self._trials = [*self._trials, entry][-MOST_TRIALS:]
        self._publish({"type": "trials", "trials": self._trials})

    def _read_ticks(self, batch: Batch) -> None:
        """Process new ticks. Add those that the live page receives to `history`."""
        values, first = batch.rows, batch.first
        if not len(values):
            return
        self._latest = time.monotonic()
        self._mode = Mode(int(values[-1, self._column["mode"]]))
        self._health.add(values, self._column, self._latest)
        chosen = decimated(first, first + len(values), self._sent, self._step)
        if chosen:
            self._sent = chosen[-1]
            rows = np.array(chosen) - first
            sent = batch.written[rows, np.newaxis]
            self.history.add(np.hstack([values[rows][:, self._indices], sent]))
            t = values[rows[-1], self._column["time"]]
            # the last decision of a trial remains
            if self._mode is ACTIVE and self._trust.is_due(t):
                self._trust.update(self.history.latest(JUDGED))

    def _read_texts(self, batch: Batch) -> None:
        """Process new events of the safety supervisor: changes of its mode, faults, and notes."""
        for _, event in batch.events:
            text = event["text"]
            if event["fault"]:
                if event["fault"] == Fault.EMERGENCY_STOP:
                    self._by_person |= not self._faults
                    text = STOPS.get(event["source"], text)
                self._faults.append(text)
            self._events_read.append({**event, "text": text})
            if is_note(event["fault"], event["source"]):
                self._notes[event["source"]] = text
                continue
            if event["mode"] == "active":
                self._armed_at = event["time"]
            self._text = text if event["mode"] in ("idle", "stopping") else ""
        if batch.events:
            self._publish(events_document(self._events_read))

    def _advice_in(self, mode: str, by_page: bool) -> str:
        """Return what the person in control can do next; empty if nothing can be done."""
        if mode == "ready" and by_page:
            return "UNLOCK, then START within 2 s, arms the drives"
        if mode == "active" and self._session["pointer"] and not self._grips:
            return "press and hold in the picture of the tool to palpate"
        return "" if self._running else self._advice
