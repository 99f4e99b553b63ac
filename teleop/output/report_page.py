"""Create the HTML page of a recording: result, estimates, figures, events and settings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from estimation import MultiEstimator
from estimation.figure_style import figure_style
from estimation.figures import Truth
from estimation.model import KELVIN_VOIGT
from estimation.redundancy import ambiguity
from teleop.evaluation.evaluation import Evaluation
from teleop.evaluation.teleoperation.rendering import RunningRendering
from teleop.output.console import number
from teleop.output.estimate_tables import (
    AT_END,
    AVERAGES,
    HEADINGS,
    LEAST_SQUARES,
    disagreement_lines,
    estimate_cells,
    evaluation_lines,
    further_lines,
)
from teleop.output.fault_report import fault_text
from teleop.output.fit_figures import complex_stiffness_figure, depth_figure, fit_figure
from teleop.output.report_result import estimate_rows, values_of
from teleop.output.result_tables import (
    complex_lines,
    meaning_lines,
    motion_line,
    result_lines,
    tangent_lines,
)
from teleop.output.step_tables import dynamic_rows, step_lines, step_tables
from teleop.output.trial_figures import (
    ambiguity_figure,
    fault_figure,
    feedback_figure,
    timing_figure,
    tracking_figure,
)
from teleop.output.trial_tables import tracking_lines
from teleop.output.web_page import svg, web_page
from teleop.recording.gaps import missing_text
from teleop.recording.recording import Recording, stated_settings
from teleop.streams.columns import OBSERVED
from teleop.streams.message import BEGIN

MARGIN = 0.1
"""Relative margin within which candidates of the multi-estimator are tied.

The candidates are pairs (b, k). The monitoring signal of a candidate is a weighted integral of its
squared force error. A candidate is tied with the best candidate if its signal exceeds the smallest
signal by at most this fraction. The data are not sufficient to choose between tied candidates.
"""
LOOKS = 400
"""Approximate number of points in time of a recording at which the tied candidates are computed."""
STATED = ("condition", "specimen", "cube", "operator", "notes", "duration_s", "clock")
"""Settings that are in the table of the trial, if they are known."""


def report_page(
    name: str,
    evaluation: Evaluation | None,
    summary: Mapping[str, Any] | None,
    recording: Recording | None = None,
    truth: Truth | None = None,
    link: str = "",
    tracking: Mapping[str, Any] | None = None,
    motion: Mapping[str, str] | None = None,
    true: Mapping[str, float] | None = None,
    felt: RunningRendering | None = None,
    felt_texts: Sequence[str] = (),
    steps: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Return a page with the results of a file.

    `evaluation` and `summary` are None if a fault stopped the trial before there were enough
    samples, `recording` if another program wrote the file. `link` is the path of the recording,
    relative to the folder of the page. `motion` has texts that describe the motion, by name. On the
    simulated rig, `truth` has the true values for the estimates, and `true` those of the result.
    `felt` has what the hand felt with force feedback, and `felt_texts` describe it. `steps` are the
    results of the steps of a protocol.
    """
    with figure_style("page"):
        values = of_recording(recording, motion or {})
        values |= of_evaluation(evaluation, summary, truth, true)
        if summary and not recording:
            values["about"] = [motion_line(summary)]
        values["tracking"] = values["feedback"] = values["steps"] = values["step_drawing"] = ""
        if steps:
            values |= {"steps": True, "step_tables": [*step_tables(steps)]}
            values["step_lines"] = [*step_lines(steps)]
            if len(rows := dynamic_rows(steps)) > 1:
                values["step_drawing"] = svg(complex_stiffness_figure(rows))
        if felt and recording:
            values["feedback"] = svg(feedback_figure(felt))
            values["feedback_lines"] = felt_texts
        if recording and tracking:
            values["tracking"] = svg(tracking_figure("", recording, tracking))
            values["tracking_lines"] = tracking_lines(tracking)
    address = quote(link or name, errors="surrogateescape")  # a name may have any bytes
    return web_page("report.html", title=name, link=address, **values)


def of_recording(recording: Recording | None, motion: Mapping[str, str]) -> dict[str, Any]:
    """Return the variables of the template about a trial; empty without a recording."""
    values: dict[str, Any] = {
        "about": [],
        "facts": [],
        "estimated_channels": [],
        "missing": "",
        "fault": "",
        "timing": "",
        "events": [],
        "settings": [],
    }
    if recording is None:
        return values
    values["facts"] = [*facts(recording, motion)]
    values["about"] = [*about(recording, motion)]
    values["events"] = event_rows(recording.events)
    values["settings"] = [*settings_rows(recording.settings)]
    values["estimated_channels"] = recording.estimated_channels
    values["missing"] = missing_text(recording.gaps)
    if fault := recording.fault:
        values["fault"] = f"{fault['text']} (at {fault['time']:.3f} s)"
        values["fault_report"] = fault_text(recording, fault)
        values["fault_drawing"] = svg(fault_figure(recording, fault))
    if recording["lateness"].any():
        skipped = int(recording["skipped"].sum())
        values["timing"] = svg(timing_figure(recording))
        values["timing_caption"] = (
            f"Lateness and duration of {len(recording)} ticks; {skipped} periods were skipped."
        )
    return values


def event_rows(events: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """Return a table of the events of a trial: time [s], mode and text, in the order of the times.

    The mode is that of the supervisor after the event. The event that marks the beginning of the
    recording is omitted, because its recorded time is wrong. Its recorded time is 0, but the
    recording begins before the rig is connected, and so before the time 0 of the trial.
    """
    return [
        [number(event["time"], 3), event.get("mode") or "", event["text"]]
        for event in sorted(events, key=itemgetter("time"))
        if event["text"] != BEGIN
    ]


def facts(recording: Recording, motion: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the rows of the last table of a report page, which describes the recorded trial.

    Each row is a name and a text. The rows are the date, the rig, the settings named in `STATED`,
    the motion, the software with its libraries, and the computer.
    """
    session = recording.session
    settings = stated_settings(recording.settings)
    yield "date", session.get("created", "not known")
    yield "rig", session.get("rig", "not known")
    if source := session.get("hand_force"):
        yield "force of the hand", source
    if observer := session.get("hand_observer"):
        yield f"observer of the hand ({OBSERVED})", observer
    for name in STATED:
        value = settings.get(name)
        if name.endswith("_s") and value is not None:
            yield name.removesuffix("_s"), f"{value:g} s"
        elif value not in (None, ""):
            yield name, str(value)
    yield from motion.items()
    for name in ("software", "python", "libraries", "machine"):
        yield name, session.get(name, "not known")


def about(recording: Recording, motion: Mapping[str, str]) -> Iterator[str]:
    """Yield short texts that state what was palpated, and how, for the line below the title."""
    settings, session = stated_settings(recording.settings), recording.session
    if condition := settings.get("condition"):
        yield f"condition {condition}"
    if specimen := settings.get("specimen"):
        yield str(specimen)
    elif cube := settings.get("cube"):
        yield f"{cube} cube"
    if duration := settings.get("duration_s"):
        yield f"{duration:g} s"
    yield from (f"{name} {text}" for name, text in motion.items() if name != "count-in")
    if rig := session.get("rig"):
        yield f"{rig} rig"
    if created := session.get("created"):
        yield f"{created[:10]} {created[11:16]}"


def of_evaluation(
    evaluation: Evaluation | None,
    summary: Mapping[str, Any] | None,
    truth: Truth | None,
    true: Mapping[str, float] | None,
) -> dict[str, Any]:
    """Return the variables of the template about the evaluation; empty without one."""
    if evaluation is None or summary is None:
        return {"summary": None, "gaps": ()}
    e, result = evaluation, summary["result"]
    values = values_of(result, true)
    stated = {one.reason for one in values}
    tangent = tangent_lines(result)
    headings, estimates = estimate_rows(summary["estimates"], truth)
    rows = summary["estimates"].items()
    return {
        "summary": summary,
        "values": values,
        "remarks": [
            *meaning_lines(summary),
            *tangent[:1],
            *(one for one in result["reasons"] if one not in stated),
        ],
        "depth": svg(depth_figure(e)),
        "result": [
            *result_lines(summary),
            *tangent,
            *complex_lines(summary),
            motion_line(summary),
        ],
        "gaps": e.gaps,
        "at_end": AT_END,
        "headings": headings,
        "estimates": estimates,
        "misfit_column": headings.index("misfit"),
        "true_row": bool(truth),
        "misfits": any(one.misfits for one in estimates),
        "disagreement": disagreement_lines(summary),
        "notes": [(name, row["note"]) for name, row in rows if row["note"]],
        "drawing": svg(e.plot("page", truth=truth)),
        "fit": svg(fit_figure("", e)),
        "averages": AVERAGES,
        "averages_headings": HEADINGS,
        "averages_cells": estimate_cells(
            {**summary["estimates"], LEAST_SQUARES: summary["least_squares"]}
        ),
        "further": further_lines(summary["estimates"]),
        "lines": evaluation_lines(summary),
        "force": svg(e.plot_force("page")),
        "ambiguity": ambiguity_drawing(e),
        "margin": f"{MARGIN:.0%}",
    }


def ambiguity_drawing(evaluation: Evaluation) -> Markup:
    """Return a figure of the tied candidates of the multi-estimator over time, as an SVG element.

    The multi-estimator selects its estimate from a grid of candidates (b, k). Candidates are tied
    if they fit the data about as well as the best candidate (see `MARGIN`).
    """
    e = evaluation
    t, regression, *_ = e.sampled
    every = max(1, len(t) // LOOKS)
    alone = replace(e.preset, estimators=("me",), model=KELVIN_VOIGT)
    fresh = alone.bank()["me"]
    assert isinstance(fresh, MultiEstimator)
    tied = ambiguity(fresh, *regression[:4], MARGIN, every)
    return svg(ambiguity_figure(t[every - 1 :: every], tied))


SUFFIXES = {"_hz": "Hz", "_s": "s", "_m": "m"}
"""Unit of a setting, by the end of its name."""
SETTING_UNITS = {
    "m": ("soft_position", "hard_position", "following_error", "depth", "lost_motion"),
    "m/s": ("max_velocity", "max_master_velocity", "rest_velocity"),
    "m/s^2": ("max_acceleration", "max_master_acceleration"),
    "m/N": ("drive_compliance", "compliance"),
    "N": ("soft_force", "hard_force", "rest_master_force", "force_noise", "max_force"),
    "s": ("preflight", "start_ramp", "max_gap", "max_age", "frozen_time", "force_lag"),
    "kg": ("mass",),
    "N s/m": ("damping",),
    "N/m": ("stiffness", "arm_stiffness"),
}
"""Names of settings without a unit in their name, by their unit."""
UNIT_OF = {name: unit for unit, names in SETTING_UNITS.items() for name in names}
"""Unit of a setting, by its name."""
INFINITE = "Infinity"
"""Text that a recording contains instead of an infinite limit."""
DIGITS = 5
"""Number of significant digits to which a value is rounded."""


def settings_rows(settings: Mapping[str, Any], start: str = "") -> Iterator[tuple[str, str]]:
    """Yield name, such as `limits.max_velocity`, and value of each setting that has one."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from settings_rows(value, f"{start}{name}.")
        elif value is not None and value not in ("", [], ()):
            yield f"{start}{name}", f"{value_text(value)} {unit_of(name, value)}".rstrip()


def value_text(value: Any) -> str:
    """Return the value of a setting, rounded to `DIGITS` digits or to an integer."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}" if abs(value) < 10.0**DIGITS else f"{value:.0f}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(value_text, value))
    return "no limit" if value == INFINITE else str(value)


def unit_of(name: str, value: Any) -> str:
    """Return the unit of a number or list of numbers, by the name of the setting; empty if none."""
    first = value[0] if isinstance(value, list | tuple) else value
    if not isinstance(first, int | float) or isinstance(first, bool):
        return ""
    suffixes = (unit for end, unit in SUFFIXES.items() if name.endswith(end))
    return UNIT_OF.get(name, next(suffixes, ""))
