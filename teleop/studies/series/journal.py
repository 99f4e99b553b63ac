"""Write and read the journal of a series.

The journal has a line for each event: a trial was started, done, spoilt or skipped. A spoilt trial
has failed and must be repeated. If a series is interrupted or killed, the journal contains all data
that are needed to resume the series.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from teleop.files import FAULT_REPORT
from teleop.json_documents import dumps, loads
from teleop.studies.json_lines import JsonLines

NAME, RECORDINGS = "journal.jsonl", "recordings"
INTERRUPTED = "interrupted"
"""Problem of a trial that was interrupted."""
Entry = Literal["plan", "started", "done", "spoilt", "skipped", "note"]


class Journal:
    """The journal in the folder of a series.

    Parameters
    ----------
    folder
        Folder of the series, which must exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lines = JsonLines(folder / NAME)
        self.entries: list[dict[str, Any]] = []
        self._last: dict[int, dict[str, Any]] = {}
        self._attempts: Counter[int] = Counter()
        self._notes: defaultdict[tuple[int, int], list[str]] = defaultdict(list)
        for _, entry in self._lines.read():
            self._add(entry)

    def write(self, entry: Entry, trial: int = 0, **values: Any) -> None:
        """Append a line to the journal, and wait until it is written to the disk.

        Parameters
        ----------
        entry
            Kind of the entry.
        trial
            Number of the trial, from 1; 0 for an entry about the whole series.
        values
            Further values of the entry. JSON must be able to represent them.

        Raises
        ------
        InputError
            The journal cannot be written.
        """
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        record = {"time": now, "entry": entry, "trial": trial, **values}
        self._lines.append([record])
        self._add(loads(dumps(record)))

    def last(self, trial: int) -> dict[str, Any] | None:
        """Return the last entry of a trial, notes excluded; None if there is no entry."""
        return self._last.get(trial)

    def attempts(self, trial: int) -> int:
        """Return the number of times that a trial was started."""
        return self._attempts[trial]

    def problem(self, trial: int) -> str:
        """Return the reason why the last attempt of a trial must be repeated.

        If the program was killed directly after a safety stop, the journal does not contain the
        reason. The returned text then names the fault report that was written at the stop.
        """
        last = self._last[trial]
        report = (self._folder / RECORDINGS / last.get("file", "")).with_suffix(FAULT_REPORT)
        after = f" after a safety stop, see {report.name}" if report.is_dir() else ""
        return str(last.get("problem", f"{INTERRUPTED}{after}"))

    def note(self, trial: int, attempt: int) -> str:
        """Return all notes on one attempt of a trial, separated by semicolons."""
        return "; ".join(self._notes[trial, attempt])

    def is_finished(self, trial: int) -> bool:
        """Return whether a trial is done or skipped."""
        last = self.last(trial)
        return last is not None and last["entry"] in ("done", "skipped")

    def results(self) -> Iterator[dict[str, Any]]:
        """Yield the last entry of each trial that is done, in the order of the trials."""
        for _, last in sorted(self._last.items()):
            if last["entry"] == "done":
                yield last

    def _add(self, entry: dict[str, Any]) -> None:
        self.entries.append(entry)
        if entry["entry"] == "started":
            self._attempts[entry["trial"]] += 1
        if entry.get("note") and "attempt" in entry:
            self._notes[entry["trial"], entry["attempt"]].append(entry["note"])
        if entry["entry"] not in ("plan", "note"):
            self._last[entry["trial"]] = entry
