"""A recording as one HTML page: estimates, figures, and what the data could not tell apart."""

from __future__ import annotations

from dataclasses import replace
from html import escape

from estimation import MultiEstimator
from estimation.model import KELVIN_VOIGT
from estimation.redundancy import ambiguity
from teleop.evaluation.evaluation import Evaluation
from teleop.output.estimate_tables import HEADINGS, estimate_cells, interval_table
from teleop.output.figures import ambiguity_figure, estimates_figure, fault_figure, timing_figure
from teleop.output.web_page import captioned, svg, table, web_page
from teleop.recording.black_box import fault_of, fault_text
from teleop.recording.gaps import missing_text
from teleop.recording.recording import Recording

MARGIN = 0.1
"""A candidate is told apart once its monitoring signal exceeds the winner's by this share."""
LOOKS = 400
"""How often the candidates that tie are looked at over a recording, about."""


def report_page(name: str, evaluation: Evaluation, recording: Recording | None = None) -> str:
    """The page for one recording.

    Parameters
    ----------
    name
        What was recorded; the page's title.
    evaluation
        The estimators' answer to it.
    recording
        The recorded trial that it was; None for a table.
    """
    e = evaluation
    summary = e.summary()
    rows = estimate_cells({**summary["estimates"], "batch": summary["batch"]})
    notes = "".join(
        f"<p>{estimator}: {escape(row['note'])}.</p>"
        for estimator, row in summary["estimates"].items()
        if row["note"]
    )
    datum = summary["datum"]
    x, v, *_ = e.regression
    figure = svg(estimates_figure(name, e.t, x, v, e.estimates))
    body = f"""<h1>{escape(name)}</h1>
<p>{summary["samples_used"]} of {summary["samples"]} samples, {summary["from_s"]:.3f} to
{summary["to_s"]:.3f} s, at {summary["rate_hz"]:g} Hz. Datum: {datum["position_m"] * 1e3:.6g} mm,
{datum["force_n"]:.6g} N ({escape(datum["source"])}). Excitation {summary["excitation"]["mean"]:.2f}
(0 none, 1 a sine about the datum).</p>
{not_measured(recording)}{missing(recording)}{gaps(e)}{black_box(recording)}<h2>Estimates</h2>
{table(HEADINGS, rows)}{table(*interval_table(summary["estimates"]))}{notes}
{
        captioned(
            figure,
            "Estimated stiffness with the displacement profile (grey), estimated damping "
            "with the velocity profile (grey); shaded, the 95 % interval of the first.",
        )
    }
<h2>What the data could not tell apart</h2>
{
        captioned(
            ambiguity_drawing(e),
            "The multi-estimator's winner (line) and the candidates whose "
            f"monitoring signal exceeds its by at most {MARGIN:.0%} (band). A wide band says that "
            "the motion of the last moments does not show this parameter.",
        )
    }
{timing(recording)}"""
    return web_page(name, body)


def stop_page(name: str, recording: Recording) -> str:
    """The page for a trial that was stopped before there was anything to estimate from."""
    body = f"<h1>{escape(name)}</h1>\n{missing(recording)}{black_box(recording)}"
    return web_page(name, body)


def not_measured(recording: Recording | None) -> str:
    """Which channels no sensor measured; empty for none."""
    names = [] if recording is None else recording.estimated_channels
    return "".join(f"<p>{escape(n)}: estimated by an observer, not measured.</p>\n" for n in names)


def missing(recording: Recording | None) -> str:
    """Which ticks are missing from a recorded trial; empty for none."""
    text = missing_text(recording.gaps) if recording else ""
    return f"<p>{escape(text)}: the estimates are not those of the run.</p>\n" if text else ""


def gaps(evaluation: Evaluation) -> str:
    """Where the estimators had no samples; empty for no gap."""
    return "".join(
        f"<p>No samples from {start:.3f} to {end:.3f} s: the filters restart there, and older "
        "samples count by their age.</p>\n"
        for start, end in evaluation.gaps
    )


def black_box(recording: Recording | None) -> str:
    """What stopped a trial for safety; empty where nothing did."""
    fault = fault_of(recording) if recording else None
    if not recording or not fault:
        return ""
    drawing = captioned(
        svg(fault_figure(recording, fault)),
        "The channels about the fault (red line), and the command that followed it.",
    )
    account = escape(fault_text(recording, fault))
    return f"<h2>Stopped for safety</h2>\n<pre>{account}</pre>{drawing}\n"


def timing(recording: Recording | None) -> str:
    """How a loop in real time kept time; empty for a table, or for virtual time."""
    if recording is None or not recording["lateness"].any():
        return ""
    skipped, ticks = int(recording["skipped"].sum()), len(recording)
    caption = f"{ticks} ticks, {skipped} periods skipped; how late each began, how long it took."
    return f"<h2>The loop</h2>\n{captioned(svg(timing_figure(recording)), caption)}"


def ambiguity_drawing(evaluation: Evaluation) -> str:
    """The bands of tied candidates over time, as an SVG element."""
    e = evaluation
    every = max(1, len(e.t) // LOOKS)
    alone = replace(e.preset, estimators=("me",), model=KELVIN_VOIGT)
    fresh = alone.bank()["me"]
    assert isinstance(fresh, MultiEstimator)
    tied = ambiguity(fresh, *e.regression[:4], MARGIN, every)
    looks = slice(every - 1, None, every)
    winner = alone.bank()["me"].run(*e.regression[:4]).part(looks)
    return svg(ambiguity_figure(e.t[looks], tied, winner))
