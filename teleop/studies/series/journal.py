"""Write and read the journal of a series.

The journal has a line for each event: a trial was started, done, spoilt or skipped. A spoilt trial
has failed and must be repeated. If a series is interrupted or killed, the journal contains all data
that are needed to resume the series.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, ValidationError, model_validator

from teleop.errors import InputError, invalid_parts
from teleop.files import FAULT_REPORT
from teleop.json_documents import dumps, loads
from teleop.studies.json_lines import JsonLines

NAME, RECORDINGS = "journal.jsonl", "recordings"
"""Names of the journal, and of the folder of the recordings, in the folder of a series."""
INTERRUPTED = "interrupted"
"""Reason why an interrupted trial must be repeated."""
Entry = Literal["plan", "started", "done", "spoilt", "skipped", "note"]
"""Kind of an entry of the journal. An attempt of a trial that is spoilt has failed."""


class Results(BaseModel):
    """The part of the summary of a trial from which the table of results is written."""

    model_config = ConfigDict(extra="allow", strict=True)

    estimates: dict[str, dict[str, Any]]
    tracking: dict[str, Any] | None = None


class Line(BaseModel):
    """An entry of the journal, as it is checked when the journal is read."""

    model_config = ConfigDict(extra="allow", strict=True)

    time: str
    entry: Entry
    trial: NonNegativeInt
    attempt: NonNegativeInt | None = None
    file: Annotated[str, Field(pattern=r"^[^/\x00]+\.mcap$")] | None = None
    note: str = ""
    summary: Results | None = None

    @model_validator(mode="after")
    def _complete(self) -> Line:
        if self.entry == "done" and None in (self.attempt, self.file, self.summary):
            raise ValueError("expected attempt, file and summary of a trial that is done")
        return self


class Journal:
    """Journal of a series of trials: a file with a line for each event of the series.

    A line is called an entry. An event is, for example, that a trial was started or is done.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lines = JsonLines(folder / NAME)
        self.entries: list[dict[str, Any]] = []
        self._last: dict[int, dict[str, Any]] = {}
        self._results: dict[int, dict[str, Any]] = {}
        self._attempts: Counter[int] = Counter()
        self._notes: defaultdict[tuple[int, int], list[str]] = defaultdict(list)
        for number, (_, entry) in enumerate(self._lines.read(), start=1):
            try:
                Line.model_validate(entry)
            except ValidationError as error:
                place = f"{self._lines.path}, line {number}"
                raise InputError(f"{place}: {invalid_parts(error)}") from error
            self._add(entry)
        for number, entry in self._results.items():
            problem = self.problem_of_recording(entry)
            if problem:
                self._last[number] = {**entry, "entry": "spoilt", "problem": f"its {problem}"}

    def problem_of_recording(self, result: Mapping[str, Any]) -> str:
        """Return why a recording is not the one that its trial wrote; empty if it is."""
        path = self._folder / RECORDINGS / result["file"]
        if not path.is_file():
            return f"recording {path.name} is missing"
        size = path.stat().st_size
        if size != result.get("size", size):
            return (
                f"recording {path.name} was replaced or changed: it has {size} bytes, expected "
                f"{result['size']}"
            )
        return ""

    def write(self, entry: Entry, trial: int = 0, **values: Any) -> None:
        """Append a line to the journal, and wait until it is written to the disk.

        `trial` is 0 for an entry about the whole series.
        """
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        record = {"time": now, "entry": entry, "trial": trial, **values}
        self._lines.append([record])
        self._add(loads(dumps(record)))

    def last(self, trial: int) -> dict[str, Any] | None:
        """Return the last entry of the journal on a trial; None if there is no entry.

        Entries that are notes of a person are ignored. If the trial is done, but its recording was
        missing or changed when the journal was opened, the returned entry is of the kind `spoilt`.
        `trial` is the number of the trial, from 1.
        """
        return self._last.get(trial)

    def attempts(self, trial: int) -> int:
        """Return the number of times that a trial was started."""
        return self._attempts[trial]

    def problem(self, trial: int) -> str:
        """Return why the last attempt of a trial must be repeated."""
        last = self._last[trial]
        report = (self._folder / RECORDINGS / last.get("file", "")).with_suffix(FAULT_REPORT)
        after = f" after a safety stop, see {report.name}" if report.is_dir() else ""
        return str(last.get("problem", f"{INTERRUPTED}{after}"))

    def note(self, trial: int, attempt: int) -> str:
        """Return all notes of a person on one attempt of a trial."""
        return "; ".join(self._notes[trial, attempt])

    def is_finished(self, trial: int) -> bool:
        """Return whether a trial is done or was skipped by a person."""
        last = self.last(trial)
        return last is not None and last["entry"] in ("done", "skipped")

    def results(self) -> Iterator[dict[str, Any]]:
        """Yield the entry of each trial that is done, even if its recording is missing."""
        for _, result in sorted(self._results.items()):
            yield result

    def _add(self, entry: dict[str, Any]) -> None:
        self.entries.append(entry)
        if entry["entry"] == "started":
            self._attempts[entry["trial"]] += 1
        if entry.get("note") and "attempt" in entry:
            self._notes[entry["trial"], entry["attempt"]].append(entry["note"])
        if entry["entry"] in ("plan", "note"):
            return
        self._last[entry["trial"]] = entry
        if entry["entry"] == "done":
            self._results[entry["trial"]] = entry
        else:
            self._results.pop(entry["trial"], None)
