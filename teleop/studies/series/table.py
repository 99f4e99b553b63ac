"""Write the results of a series to a CSV file, with a row for each trial and estimator."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from teleop.evaluation.tracking import COLUMNS as TRACKING
from teleop.files import write_text
from teleop.studies.series.journal import Journal
from teleop.studies.series.plan import PlannedTrial

NAME, RECORDINGS = "trials.csv", "recordings"
RESULTS = {
    "k": "k [N/m]",
    "b": "b [N s/m]",
    "k_end": "k at the end [N/m]",
    "k_interval": "k at the end, half of the 95 % interval [N/m]",
    "b_end": "b at the end [N s/m]",
    "b_interval": "b at the end, half of the 95 % interval [N s/m]",
    "e_f": "e_f [N]",
    "one_step_rms": "one-step rms [N]",
    "rise_time_s": "rise time [s]",
    "held": "held",
}
"""Column headings for the values in the summary of an estimator."""


def result_rows(trials: Sequence[PlannedTrial], journal: Journal) -> Iterator[dict[str, Any]]:
    """Yield a row for each estimator of each trial that is done."""
    planned = {trial.number: trial for trial in trials}
    for result in journal.results():
        trial, summary = planned[result["trial"]], result["summary"]
        tracking = summary["tracking"] or {}
        for name, values in summary["estimates"].items():
            yield {
                "trial": trial.number,
                **trial.levels,
                "repetition": trial.repetition,
                "attempt": result["attempt"],
                "time": result["time"],
                "file": result["file"],
                "note": journal.note(trial.number, result["attempt"]),
                "seed": summary["seed"],
                "estimator": name,
                **{RESULTS[key]: values[key] for key in RESULTS},
                **{TRACKING[key]: tracking.get(key) for key in TRACKING},
            }


def write_results(folder: Path, trials: Sequence[PlannedTrial], journal: Journal) -> None:
    """Write the table of results to a CSV file in the folder of a series.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    rows = [*result_rows(trials, journal)]
    if not rows:
        return
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, fieldnames=[*rows[0]])
    writer.writeheader()
    writer.writerows(rows)
    write_text(folder / NAME, text.getvalue(), overwrite=True)
