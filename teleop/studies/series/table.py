"""Write the results of a series to a CSV file, with a row for each estimator of each trial."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from drivers.input_file import open_input
from estimation.quantities import DAMPING, FORCE_ERROR, STIFFNESS
from teleop.evaluation.teleoperation.tracking import COLUMNS as TRACKING
from teleop.files import encoded, unreadable, write_text
from teleop.studies.series.journal import Journal
from teleop.studies.series.trials import PlannedTrial

NAME = "trials.csv"
RESULT_COLUMNS = {
    "k": STIFFNESS.column,
    "b": DAMPING.column,
    "k_end": f"k at the end [{STIFFNESS.si}]",
    "k_interval": f"k at the end, half of the 95 % interval [{STIFFNESS.si}]",
    "b_end": f"b at the end [{DAMPING.si}]",
    "b_interval": f"b at the end, half of the 95 % interval [{DAMPING.si}]",
    "e_f": FORCE_ERROR.column,
    "one_step_rms": "one-step rms [N]",
    "rise_time_s": "rise time [s]",
    "held": "held",
}
"""Headings of the columns with results, by the key of the result in the summary of a trial."""


def result_rows(trials: Sequence[PlannedTrial], journal: Journal) -> Iterator[dict[str, Any]]:
    """Yield a row of the table of results for each estimator of each trial that is done.

    A row contains the values by the heading of the column. If an older version of the program did
    not write a value to the journal, this value is None.
    """
    planned = {trial.number: trial for trial in trials}
    for result in journal.results():
        trial, summary = planned[result["trial"]], result["summary"]
        tracking = summary.get("tracking") or {}
        for name, values in summary["estimates"].items():
            yield {
                "trial": trial.number,
                **trial.levels,
                "repetition": trial.repetition,
                "attempt": result["attempt"],
                "time": result["time"],
                "file": result["file"],
                "note": journal.note(trial.number, result["attempt"]),
                "seed": None if trial.settings.rig else summary.get("seed"),
                "software": summary.get("software"),
                "estimator": name,
                **{RESULT_COLUMNS[key]: values.get(key) for key in RESULT_COLUMNS},
                **{TRACKING[key]: tracking.get(key) for key in TRACKING},
            }


def columns(trials: Sequence[PlannedTrial]) -> list[str]:
    """Return the headings of the table of results, with a column for each factor."""
    return [
        "trial",
        *trials[0].levels,
        *("repetition", "attempt", "time", "file", "note", "seed", "software", "estimator"),
        *RESULT_COLUMNS.values(),
        *TRACKING.values(),
    ]


def write_results(folder: Path, trials: Sequence[PlannedTrial], journal: Journal) -> None:
    """Write the results of a series to its CSV file, unless it has the same contents."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, fieldnames=columns(trials))
    writer.writeheader()
    writer.writerows(result_rows(trials, journal))
    path, content = folder / NAME, text.getvalue()
    try:
        is_written = False
        if path.exists():
            with open_input(path) as file:
                is_written = file.read() == encoded(content)
    except OSError as error:
        raise unreadable(path, error) from error
    if not is_written:
        write_text(path, content, overwrite=True)
