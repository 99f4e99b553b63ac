"""Print estimates of k and b: final values with 95 % intervals, averages, and remarks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from estimation.expected_intervals import half_width_text
from estimation.misfit import LARGEST_MISFIT
from estimation.quantities import DAMPING, FORCE_ERROR, RESULTS, STIFFNESS, Quantity
from teleop.names import FORCE_SENSOR
from teleop.output.console import number, plain_console, print_table, small
from teleop.output.result_tables import (
    print_models,
    print_result,
    print_result_details,
    with_half,
)
from teleop.output.step_tables import print_steps
from teleop.recording.gaps import Gap, missing_text

LARGE_JITTER = 20.0
"""Deviation of a sample period from the median, as a fraction of the median, above which a warning
is printed."""
GAPS_LISTED = 3
"""Largest number of gaps between samples that are listed."""
MEANINGLESS = 1e6
"""An interval is shown only if the ratio of its half width to the estimate is less than this value.
A wider interval contains no information."""
HEADINGS = ("", *(one.heading for one in RESULTS.values()), "one-step rms [N]", "rise time [s]")
"""Headings of the table of averages."""
AVERAGES = "averages, from the first estimate of each estimator on"
"""Title of the table of averages."""
ONLINE = "online, at the end"
"""Heading of the names of the estimators, in the table of estimates at the end."""
AT_END = "estimates at the end, \u00b1 95 % interval"
"""Title of the table of estimates at the end."""
LEAST_SQUARES = "least squares"
"""Name of the least-squares fit to all samples, in the table of averages."""
COMPARISON = "compared with least squares"
"""Title of the table that compares the estimators with least squares."""
UNSUPPORTED = "the record does not support the estimates of the online estimators"
DETAILS = "--details prints all models, averages, datum and filters"
"""Last line of the short text."""
RMS_RATIO = "rms/window"
"""Heading of a column: the root mean square error of the force that an estimator predicts one step
ahead, divided by the same error of least squares over a window (`model_comparison.WINDOW`)."""


def estimate_cells(rows: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Return the cells of the table of averages (see `HEADINGS`), one row for each estimator."""
    return [
        [
            name,
            STIFFNESS.number(row["k"]),
            number(DAMPING.shown(row["b"]), digits(row["b"])),
            small(FORCE_ERROR.shown(row["e_f"])),
            small(row["one_step_rms"]),
            number(row.get("rise_time_s", math.nan), 3),
        ]
        for name, row in rows.items()
    ]


def digits(value: float) -> int:
    """Return the number of decimals with which a damping [N s/m] is printed."""
    return DAMPING.decimals if abs(value) < 1000.0 else 0


def with_interval(quantity: Quantity, value: float, half: float, decimals: int) -> str:
    """Return an SI value and the half width of its 95 % interval, for example "12.30 +- 0.45".

    The half width determines the digits (`with_half`). If it is not known, or is so large that the
    interval contains no information (`MEANINGLESS`), only the value is printed, with `decimals`
    decimals.
    """
    value, half = quantity.shown(value), quantity.shown(half)
    if not half < MEANINGLESS * max(abs(value), 1.0):
        return number(value, decimals)
    if half == 0.0:
        return f"{number(value, decimals)} \u00b1 {number(half, decimals)}"
    return with_half(value, half)


def print_estimates(rows: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the final estimates, and remarks on each estimator."""
    console = plain_console()
    headings, cells = interval_table(rows)
    print_table(console, "", [ONLINE, *headings[1:]], cells, lines=False)
    for line in further_lines(rows):
        console.print(f"  {line}")
    if doubtful := [name for name, row in rows.items() if row["misfit"] > LARGEST_MISFIT]:
        console.print(
            f"  misfit above {LARGEST_MISFIT:.0%}: {', '.join(doubtful)} "
            "(wrong model, or estimate not settled)",
            style="yellow",
        )
    for name, row in rows.items():
        if row["held"] == 1.0:
            console.print(f"  {name}: no estimate: no contact or no motion", style="red")
        if row["note"]:
            console.print(f"  {name}: {row['note']}", style="yellow")


def print_online(
    summary: Mapping[str, Any], further: Mapping[str, Mapping[str, Any]], details: bool
) -> None:
    """Print the estimates of the online estimators; if the result has no k, only with `details`.

    `further` contains further rows of the averages, which are printed with `details`.
    """
    console = plain_console()
    if not (details or summary["result"]["identifiable"]):
        console.print(f"  {UNSUPPORTED}: --details prints them", style="yellow")
        return
    print_estimates(summary["estimates"])
    if details:
        print_averages(summary["estimates"], further)
    for line in disagreement_lines(summary):
        console.print(f"  {line}", style="yellow")


def print_averages(
    rows: Mapping[str, Mapping[str, Any]], further: Mapping[str, Mapping[str, Any]]
) -> None:
    """Print the comparison of the estimators with least squares, and averages over the record.

    `further` contains further rows of the averages.
    """
    console = plain_console()
    if compared := comparison_table(rows):
        print_table(console, COMPARISON, *compared)
    print_table(console, AVERAGES, HEADINGS, estimate_cells({**rows, **further}))


def further_lines(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return lines with the final estimates of parameters besides k and b, such as k3."""
    lines = []
    for name, row in rows.items():
        if row["held"] == 1.0:
            continue
        texts = []
        for parameter, value in row["further"].items():
            half, unit = row["further_interval"][parameter], row["further_unit"][parameter]
            texts.append(f"{parameter} {with_half(value, half)} {unit}".removesuffix(" -"))
        if texts:
            lines.append(f"{name} at the end: {', '.join(texts)}")
    return lines


def interval_table(rows: Mapping[str, Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells of the table of the final estimates, one row for each estimator."""
    timed = any("cost_us" in row for row in rows.values())
    headings = [
        "",
        STIFFNESS.heading,
        DAMPING.heading,
        "held",
        "misfit",
        *(["cost [us]"] if timed else []),
    ]
    cells = [
        [
            name,
            with_interval(STIFFNESS, row["k_end"], row["k_interval"], STIFFNESS.decimals),
            with_interval(DAMPING, row["b_end"], row["b_interval"], digits(row["b_end"])),
            percent(row["held"]),
            percent(row["misfit"]),
            *([number(row["cost_us"], 1)] if timed else []),
        ]
        for name, row in rows.items()
    ]
    return headings, cells


def comparison_table(
    rows: Mapping[str, Mapping[str, Any]],
) -> tuple[list[str], list[list[str]]] | None:
    """Return headings and cells of the comparison with least squares; None without results."""
    cells = [
        [
            name,
            small(row["one_step_ratio"]),
            percent(row["k_coverage"]),
            percent(row["b_coverage"]),
        ]
        for name, row in rows.items()
        if "one_step_ratio" in row
    ]
    return (["", RMS_RATIO, "k within", "b within"], cells) if cells else None


def percent(share: float) -> str:
    """Return a fraction as text in percent; a dash if the fraction is not finite."""
    return f"{share:.0%}" if math.isfinite(share) else "-"


def left_out_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return which part of the record results and tables leave out, as at most one line."""
    left_out = summary["left_out"]
    return [f"left out: {left_out}"] if left_out else []


def print_estimated(console: Console, summary: Mapping[str, Any]) -> None:
    """Print the names of the channels without a sensor, whose values an observer estimated."""
    for name in summary.get("estimated_channels", ()):
        console.print(f"  {name}: estimated by an observer, not measured", style="yellow")
    if (source := summary.get("hand_force", FORCE_SENSOR)) != FORCE_SENSOR:
        console.print(f"  force of the hand: {source}")
    if observer := summary.get("observer"):
        console.print(
            f"  observer of the hand: differs by {observer['rms_difference_n']:.2g} N rms from the "
            f"coupling ({observer['rms_coupling_n']:.2g} N rms); not used by the controller"
        )


def print_reading(console: Console, summary: Mapping[str, Any]) -> None:
    """Print what was changed when the file was read, for example how many samples were left out."""
    for note in summary["reading"]:
        console.print(f"  {note}", style="yellow")


def print_evaluation(summary: Mapping[str, Any], name: str, details: bool) -> None:
    """Print the document that `teleop estimate --json` writes.

    Without `details`, the usual text fits a terminal of 24 lines: the result, the final
    estimates, and warnings.
    """
    console = plain_console()
    print_result(summary, name)
    if details:
        print_result_details(summary)
        print_models(summary)
    if summary.get("steps"):
        print_steps(summary["steps"])
    print_online(summary, {LEAST_SQUARES: summary["least_squares"]}, details)
    for line in evaluation_lines(summary) if details else left_out_lines(summary):
        console.print(f"  {line}")
    print_estimated(console, summary)
    print_reading(console, summary)
    print_model(console, summary)
    print_gaps(console, summary, details)
    if not details:
        console.print(f"  {DETAILS}")


LARGEST_DIFFERENCE, LARGEST_DIFFERENCE_OF_B = 0.1, 0.5
"""Differences of the k and of the b of an online estimator from the result that are stated, as
fractions of k and b."""


def disagreement_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return where the final estimates differ from the result, as at most one line.

    They must also differ by more than their own interval and that of the result.
    """
    result = summary["result"]
    if not result["identifiable"]:
        return [f"{UNSUPPORTED}: see the reasons of the result"]
    differences = []
    for symbol, limit in (("k", LARGEST_DIFFERENCE), ("b", LARGEST_DIFFERENCE_OF_B)):
        value = result[symbol]
        if value is None or (symbol == "b" and result["b_reason"]):
            continue
        least = max(limit * abs(value), value - result[f"{symbol}_low"])
        found = [
            name
            for name, row in summary["estimates"].items()
            if abs(row[f"{symbol}_end"] - value) > max(least, row[f"{symbol}_interval"])
        ]
        if found:
            differences.append(f"{symbol} of {', '.join(found)} differs by >{limit:.0%}")
    return [f"publish the result: {', '.join(differences)}"] if differences else []


def evaluation_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return lines that state samples, datum, filters and memory, and the expected intervals."""
    datum = summary["datum"]
    lag, lost = summary["force_lag_s"], summary["lost_motion_m"]
    corrected = [
        *([f"force lag of {lag * 1e3:.4g} ms"] if lag else []),
        *([f"lost motion of {lost * 1e6:.4g} um"] if lost else []),
    ]
    return [
        f"{summary['samples_used']} of {summary['samples']} samples, {summary['from_s']:.3f} to "
        f"{summary['to_s']:.3f} s; sample period: median {1e3 / summary['rate_hz']:.4g} ms, "
        f"longest {summary['longest_gap_s'] * 1e3:.4g} ms",
        f"datum: {datum['position_m'] * 1e3:.6g} mm, {datum['force_n']:.6g} N ({datum['source']})",
        f"conditioning: {summary['conditioning']}, bandwidth {summary['bandwidth_hz']:.3g} Hz; "
        + f"corrected for {' and '.join(corrected) or 'no force lag and no lost motion'}",
        *online_lines(summary),
        *left_out_lines(summary),
        f"memory of the estimators: {summary['memory_s']:.3g} s",
        expected_text(summary["expected_intervals"]),
        summary["software"],
    ]


def expected_text(expected: Mapping[str, float]) -> str:
    """Return one line with the intervals of k and b that motion and noise permit."""
    halves = ", ".join(f"{part} {half_width_text(half)}" for part, half in expected.items())
    return f"expected 95 % intervals for this motion and noise: {halves}"


def online_lines(summary: Mapping[str, Any]) -> list[str]:
    """Return why the online estimates of a trial differ from the result: 0 or 1 line."""
    known = summary["transmission"] or {}
    causes = [
        name
        for name, key in (("lag", "force_lag_s"), ("lost motion", "lost_motion_m"))
        if known.get(key, 0.0) > summary[key]
    ]
    if not causes:
        return []
    verb = "reduce" if len(causes) > 1 else "reduces"
    return [
        "the online estimates are not corrected, as in the trial: "
        f"{' and '.join(causes)} {verb} their b"
    ]


def print_gaps(console: Console, summary: Mapping[str, Any], details: bool) -> None:
    """Print gaps and unusual periods, and whether the estimates of a trial are those of the run.

    That they are is printed only with `details`.
    """
    gaps = summary["gaps"]
    for gap in gaps[:GAPS_LISTED]:
        console.print(
            f"  no samples from {gap['from_s']:.3f} to {gap['to_s']:.3f} s: the filters start "
            "again after this gap, and the samples before it have less weight",
            style="yellow",
        )
    if len(gaps) > GAPS_LISTED:
        console.print(f"  and {len(gaps) - GAPS_LISTED} more gaps", style="yellow")
    if summary["jitter"] > LARGE_JITTER:
        console.print(
            f"  the longest time between two samples is {summary['longest_gap_s']:.3g} s: position "
            "and force are interpolated linearly in between",
            style="yellow",
        )
    if "as_online" not in summary:
        return
    if summary["missing_ticks"]:
        missing = missing_text([Gap(*row.values()) for row in summary["missing_ticks"]])
        console.print(f"  the estimates are not those of the run: {missing}", style="red")
    elif missing := summary["missing_estimates"]:
        console.print(
            f"  the run did not record the estimates of {missing} of {summary['samples_used']} "
            "samples, because they were late or an estimator had failed: all are computed here",
            style="yellow",
        )
    elif not summary["as_online"]:
        console.print(
            "  the settings are not those of the run, so that the estimates differ from those of "
            "the run"
        )
    elif details:
        console.print("  the estimates are exactly those that the run computed")


def print_model(console: Console, summary: Mapping[str, Any]) -> None:
    """Print remarks on the models of the estimators.

    The first remark names the estimators that do not use the model that the user has chosen. The
    second remark is printed only if positions are measured from the mean of the motion. It names
    the estimators whose model needs positions that are measured from the contact point.
    """
    from_contact = summary["from_contact"]
    if summary["own_model"]:
        console.print(f"  model {summary['model']}, but for {', '.join(summary['own_model'])}")
    if from_contact and summary["datum"]["source"] == "mean of the motion":
        console.print(
            f"  {', '.join(from_contact)}: position must be measured from the contact, and zero "
            "is the mean of the motion here: expected --datum",
            style="yellow",
        )
