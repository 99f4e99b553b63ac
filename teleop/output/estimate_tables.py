"""What the commands print of estimates: the table, and how far each can be trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from estimation.misfit import LARGEST_MISFIT
from teleop.output.console import number, plain_console, print_table, small
from teleop.output.result_tables import print_models, print_result
from teleop.recording.gaps import Gap, missing_text

STALL = 20.0
"""A sample period this many times longer than the median is reported."""
GAPS_LISTED = 3
"""Most gaps that are listed."""
MEANINGLESS = 1e6
"""An interval this many times its value is not shown: nothing has been learned."""
HEADINGS = ("", "k [N/m]", "b [N s/m]", "e_f [N]", "one-step rms [N]", "rise time [s]")
"""Of the table of estimators."""


def estimate_cells(rows: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """The table of estimators as text, a row each, below `HEADINGS`."""
    return [
        [
            name,
            number(row["k"], 0),
            number(row["b"], digits(row["b"])),
            small(row["e_f"]),
            small(row["one_step_rms"]),
            number(row.get("rise_time_s", math.nan), 3),
        ]
        for name, row in rows.items()
    ]


def digits(value: float) -> int:
    """Decimals of a damping."""
    return 1 if abs(value) < 1000.0 else 0


def with_interval(value: float, half: float, decimals: int) -> str:
    """A value with half of its 95 % interval, where there is one."""
    if not half < MEANINGLESS * max(abs(value), 1.0):
        return number(value, decimals)
    if 0.0 < half < 1.0:
        decimals = max(decimals, min(1 - math.floor(math.log10(half)), 4))
    return f"{number(value, decimals)} \u00b1 {number(half, decimals)}"


def print_estimates(rows: Mapping[str, Mapping[str, Any]], title: str) -> None:
    """The table of estimators, and what to know of each."""
    print_table(plain_console(), title, HEADINGS, estimate_cells(rows))
    print_intervals(rows)


def print_intervals(rows: Mapping[str, Mapping[str, Any]]) -> None:
    """What each estimator says at the end, how far it can be trusted, and what to know of it."""
    console = plain_console()
    print_table(console, "", *interval_table(rows))
    for name, row in rows.items():
        further = [f"{parameter} {value:.4g}" for parameter, value in row["further"].items()]
        if further:
            console.print(f"  {name}: {', '.join(further)} at the end")
        if row["held"] == 1.0:
            console.print(f"  {name}: held throughout, for want of contact or motion", style="red")
        if row["misfit"] > LARGEST_MISFIT:
            console.print(
                f"  {name}: a systematic force error of {row['misfit']:.0%} at the end: this "
                "model, or this estimate, does not describe the body",
                style="yellow",
            )
        if row["note"]:
            console.print(f"  {name}: {row['note']}", style="yellow")


def interval_table(rows: Mapping[str, Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Headings and cells: the estimates at the end with their intervals, and how often held.

    With a comparison, see `teleop.evaluation.model_comparison.Comparison`, and a cost, these too.
    """
    compared = any("one_step_ratio" in row for row in rows.values())
    headings = ["at the end", "k [N/m]", "b [N s/m]", "held", "misfit"]
    if compared:
        headings += ["rms/batch", "k within", "b within"]
    timed = any("cost_us" in row for row in rows.values())
    if timed:
        headings.append("cost [us]")
    cells = []
    for name, row in rows.items():
        cells.append(
            [
                name,
                with_interval(row["k_end"], row["k_interval"], 0),
                with_interval(row["b_end"], row["b_interval"], digits(row["b_end"])),
                percent(row["held"]),
                percent(row["misfit"]),
            ]
        )
        if compared:
            cells[-1] += [
                small(row["one_step_ratio"]),
                percent(row["k_coverage"]),
                percent(row["b_coverage"]),
            ]
        if timed:
            cells[-1].append(number(row["cost_us"], 1))
    return headings, cells


def percent(share: float) -> str:
    """A share, or a dash where there is none."""
    return f"{share:.0%}" if math.isfinite(share) else "-"


def print_estimated(console: Console, summary: Mapping[str, Any]) -> None:
    """Which channels no sensor measured."""
    for name in summary.get("estimated_channels", ()):
        console.print(f"  {name}: estimated by an observer, not measured", style="yellow")


def print_reading(console: Console, summary: Mapping[str, Any]) -> None:
    """Print what was done to the samples on reading."""
    for note in summary["reading"]:
        console.print(f"  {note}", style="yellow")


def print_evaluation(summary: Mapping[str, Any], name: str) -> None:
    """Print a recording's tables: the number to publish, the models, then the estimators."""
    console = plain_console()
    print_result(summary, name)
    print_models(summary)
    rows = {**summary["estimates"], "batch": summary["batch"]}
    title = "online estimators, averages over the record"
    print_table(console, title, HEADINGS, estimate_cells(rows))
    print_intervals(summary["estimates"])
    datum = summary["datum"]
    console.print(
        f"  {summary['samples_used']} of {summary['samples']} samples, "
        f"{summary['from_s']:.3f} to {summary['to_s']:.3f} s, at {summary['rate_hz']:g} Hz, "
        f"jitter {summary['jitter']:.1%}\n"
        f"  datum: {datum['position_m'] * 1e3:.6g} mm, {datum['force_n']:.6g} N "
        f"({datum['source']})\n"
        f"  conditioning bandwidth {summary['bandwidth_hz']:.3g} Hz, "
        f"memory of the estimators {summary['memory_s']:.3g} s\n"
        f"  excitation: {summary['excitation']['mean']:.2f} (0 none, 1 a sine about the datum)"
    )
    print_estimated(console, summary)
    print_reading(console, summary)
    print_model(console, summary)
    print_gaps(console, summary)


def print_gaps(console: Console, summary: Mapping[str, Any]) -> None:
    """Where samples are missing, and whether the estimates are those of the run."""
    gaps = summary["gaps"]
    for gap in gaps[:GAPS_LISTED]:
        console.print(
            f"  no samples from {gap['from_s']:.3f} to {gap['to_s']:.3f} s: the filters restart "
            "there, and older samples count by their age",
            style="yellow",
        )
    if len(gaps) > GAPS_LISTED:
        console.print(f"  and {len(gaps) - GAPS_LISTED} more gaps", style="yellow")
    if summary["jitter"] > STALL:
        console.print(
            f"  the loop took no sample for up to {summary['longest_gap_s']:.3g} s: position and "
            "force are taken for straight lines meanwhile, as in the run",
            style="yellow",
        )
    if "as_online" not in summary:
        return
    if summary["missing_ticks"]:
        missing = missing_text([Gap(*row.values()) for row in summary["missing_ticks"]])
        console.print(f"  the estimates are not those of the run: {missing}", style="red")
    else:
        console.print(
            "  the estimates are those that the run computed, to the bit"
            if summary["as_online"]
            else "  other settings than the run's: the estimates are not those that it computed"
        )


def print_model(console: Console, summary: Mapping[str, Any]) -> None:
    """What the model needs, and who does not take it."""
    from_contact = summary["from_contact"]
    if summary["own_model"]:
        console.print(f"  model {summary['model']}, but for {', '.join(summary['own_model'])}")
    if from_contact and summary["datum"]["source"] == "mean of the motion":
        console.print(
            f"  {', '.join(from_contact)}: position must be measured from the contact, and zero "
            "is the mean of the motion here: expected --datum",
            style="yellow",
        )
