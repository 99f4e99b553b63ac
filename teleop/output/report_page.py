"""The HTML page of a recording: estimates, figures, and candidates that tie."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from markupsafe import Markup

from estimation import MultiEstimator
from estimation.model import KELVIN_VOIGT
from estimation.redundancy import ambiguity
from teleop.evaluation.evaluation import Evaluation
from teleop.output.estimate_tables import (
    AT_END,
    AVERAGES,
    HEADINGS,
    estimate_cells,
    interval_table,
)
from teleop.output.fault_report import fault_text
from teleop.output.figures import estimates_figure
from teleop.output.trial_figures import ambiguity_figure, fault_figure, timing_figure
from teleop.output.web_page import svg, web_page
from teleop.recording.gaps import missing_text
from teleop.recording.recording import Recording

MARGIN = 0.1
"""Candidates are separated when their monitoring signals differ by more than this share."""
LOOKS = 400
"""Approximate number of times at which the tied candidates of a recording are determined."""


def report_page(
    name: str, evaluation: Evaluation | None, recording: Recording | None = None
) -> str:
    """Return the page for one recording.

    Parameters
    ----------
    name
        Name of the recording, the title of the page.
    evaluation
        Its evaluation; None for a trial that ended before there were samples.
    recording
        The recorded trial; None for a table.
    """
    values = of_recording(recording) | of_evaluation(name, evaluation)
    return web_page("report.html", title=name, **values)


def of_recording(recording: Recording | None) -> dict[str, Any]:
    """Return what the page shows of a recorded trial."""
    values: dict[str, Any] = {
        "estimated_channels": [],
        "missing": "",
        "fault": "",
        "timing": "",
    }
    if recording is None:
        return values
    values["estimated_channels"] = recording.estimated_channels
    values["missing"] = missing_text(recording.gaps)
    if fault := recording.fault:
        values["fault"] = fault_text(recording, fault)
        values["fault_drawing"] = svg(fault_figure(recording, fault))
    if recording["lateness"].any():
        skipped = int(recording["skipped"].sum())
        values["timing"] = svg(timing_figure(recording))
        values["timing_caption"] = (
            f"Lateness and duration of {len(recording)} ticks; {skipped} periods were skipped."
        )
    return values


def of_evaluation(name: str, evaluation: Evaluation | None) -> dict[str, Any]:
    """Return what the page shows of an evaluation."""
    if evaluation is None:
        return {"summary": None, "gaps": ()}
    e = evaluation
    summary = e.summary()
    x, v, *_ = e.regression
    headings, intervals = interval_table(summary["estimates"])
    rows = summary["estimates"].items()
    return {
        "summary": summary,
        "gaps": e.gaps,
        "at_end": AT_END,
        "averages": AVERAGES,
        "headings": HEADINGS,
        "estimates": estimate_cells({**summary["estimates"], "batch": summary["batch"]}),
        "interval_headings": headings,
        "intervals": intervals,
        "notes": [(estimator, row["note"]) for estimator, row in rows if row["note"]],
        "drawing": svg(estimates_figure(name, e.t, x, v, e.estimates)),
        "ambiguity": ambiguity_drawing(e),
        "margin": f"{MARGIN:.0%}",
    }


def ambiguity_drawing(evaluation: Evaluation) -> Markup:
    """Return the bands of tied candidates over time as an SVG element."""
    e = evaluation
    every = max(1, len(e.t) // LOOKS)
    alone = replace(e.preset, estimators=("me",), model=KELVIN_VOIGT)
    fresh = alone.bank()["me"]
    assert isinstance(fresh, MultiEstimator)
    tied = ambiguity(fresh, *e.regression[:4], MARGIN, every)
    looks = slice(every - 1, None, every)
    winner = alone.bank()["me"].run(*e.regression[:4]).part(looks)
    return svg(ambiguity_figure(e.t[looks], tied, winner))
