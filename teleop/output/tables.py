"""What the commands print: tables for a person, or one JSON document for a program."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from teleop.json_documents import dumps
from teleop.printable import printable
from teleop.recording.black_box import moment
from teleop.recording.gaps import Gap, missing_text

if TYPE_CHECKING:
    from teleop.control.tare import Tare

WIDTH, HEIGHT = 10_000, 25
"""Of the console: a table takes what it needs, and a narrower terminal wraps its lines."""
STALL = 0.05
"""A gap between ticks [s] after which a trial is told to have stalled."""


def print_json(document: Mapping[str, Any]) -> None:
    """Print a JSON document in which numbers that are not finite have become null."""
    print(dumps(dict(document), indent=2), flush=True)


class PlainConsole(Console):
    """A console whose texts cannot control the terminal, whatever file they come from."""

    def render_str(self, text: str, **options: Any) -> Text:
        """The text with its control characters shown."""
        return super().render_str(printable(text), **options)

    def on_broken_pipe(self) -> None:
        """Raise the BrokenPipeError: rich would exit, whatever remains to be reported."""
        raise


def plain_console(stream: TextIO | None = None) -> Console:
    """A console that takes text as it is: no markup, no highlighting, nothing cut off.

    Given both width and height, rich asks neither the terminal nor the environment: it takes 80
    columns for a terminal of the type `dumb`, whatever its width is set to.
    """
    return PlainConsole(
        file=stream, highlight=False, markup=False, soft_wrap=True, width=WIDTH, height=HEIGHT
    )


def number(value: float, digits: int) -> str:
    """A number with thousands set apart, or a dash where there is none."""
    return f"{value:,.{digits}f}".replace(",", " ") if math.isfinite(value) else "-"


def small(value: float) -> str:
    """A number of any size with three digits that count."""
    if not math.isfinite(value) or value == 0.0:
        return number(value, 3)
    return number(value, min(max(2 - math.floor(math.log10(abs(value))), 0), 9))


def print_trial(summary: Mapping[str, Any]) -> None:
    """A trial's tables."""
    from teleop.output.estimate_tables import print_estimated, print_estimates

    console = plain_console()
    if summary["estimates"]:
        print_estimates(
            summary["estimates"],
            f"{summary['condition']}, {palpated(summary)}, {summary['duration_s']:g} s",
        )
    if summary["truth"]:
        print_truth(console, summary["truth"])
    print_estimated(console, summary)
    console.print(
        f"  excitation: {summary['excitation']['mean']:.2f} (0 none, 1 a sine of 1 Hz about zero)"
    )
    loop = summary["loop"]
    if summary["clock"] == "virtual":
        console.print(f"  loop: {summary['ticks']} ticks at {loop['rate_hz']:g} Hz, virtual time")
    else:
        print_loop(console, summary)
    print_rejected(console, summary["rejected"])
    print_safety(console, summary["safety"])
    recording = summary["recording"]
    if recording["path"]:
        console.print(f"  recording: {recording['path']}")
    print_incomplete(console, recording)
    if recording["black_box"]:
        console.print(f"  black box: {recording['black_box']}", style="red")
    if recording["black_box_problem"]:
        console.print(f"  {recording['black_box_problem']}", style="red")


def print_incomplete(console: Console, recording: Mapping[str, Any]) -> None:
    """Which ticks the recording does not hold, and what can be done about it."""
    if recording["missing_ticks"]:
        missing = missing_text([Gap(*row.values()) for row in recording["missing_ticks"]])
        console.print(
            f"  {missing}:\n  the recorder could not keep up; the loop and the estimators had "
            "these ticks, the averages above do not",
            style="red",
        )
    if recording["problem"]:
        console.print(f"  the recording is not complete: {recording['problem']}", style="red")
        if recording["recoverable"]:
            console.print(
                "  the tables above are computed from its intact part; write that to a complete "
                f"file with: teleop recover {recording['path']}"
            )
        else:
            console.print("  the tables above are computed from the last seconds, kept in memory")


def palpated(summary: Mapping[str, Any]) -> str:
    """What a trial was on."""
    simulated = summary["rig"] == "simulated"
    return f"{summary['cube']} cube" if simulated else str(summary["rig"])


def print_truth(console: Console, truth: Mapping[str, Any]) -> None:
    """What the simulated cube is."""
    console.print(
        f"  truth (simulated): b {truth['b']:g} N s/m, k {number(truth['k_surface'], 0)} N/m at "
        f"the surface\n  to {number(truth['k_deepest'], 0)} N/m at the deepest; the force channel "
        f"lags by {truth['force_lag_s'] * 1e3:g} ms,\n  which alone reads as b - k * lag"
    )


def print_loop(console: Console, summary: Mapping[str, Any]) -> None:
    """How the loop kept time."""
    loop = summary["loop"]
    late, busy = loop["lateness_us"], loop["tick_us"]["busy"]
    few = summary["pairs"] < summary["ticks"]
    pairs = f" with {summary['pairs']} pairs of force and position" if few else ""
    console.print(
        f"  loop: {loop['mean_rate_hz']:.2f} of {loop['rate_hz']:g} Hz, {summary['ticks']} ticks"
        f"{pairs}, {loop['overruns']} overruns, {loop['skipped']} periods skipped;\n"
        f"  lateness [us]: p50 {late['p50']:.1f}, p99 {late['p99']:.1f}, "
        f"p99.9 {late['p99_9']:.1f}, max {late['max']:.1f};\n"
        f"  a tick takes [us]: p50 {busy['p50']:.0f}, p99 {busy['p99']:.0f}, max {busy['max']:.0f}"
    )
    steps = summary["realtime"]
    missing = [f"{name} {why}" for name, why in steps.items() if why != "done"]
    if missing:
        console.print(f"  real time: {'; '.join(missing)}", style="yellow")
    elif steps:
        console.print(f"  real time: {', '.join(steps)}")
    if loop["longest_gap_s"] > STALL:
        console.print(
            f"  the loop stalled for {loop['longest_gap_s']:.2f} s: the estimates around that "
            "time are not valid",
            style="red",
        )
    if loop["mean_rate_hz"] < 0.99 * loop["rate_hz"]:
        console.print("  the loop did not hold its rate", style="yellow")


def print_rejected(console: Console, rejected: Mapping[str, Mapping[str, int]]) -> None:
    """What devices sent and was not taken."""
    for device, counts in rejected.items():
        reasons = ", ".join(f"{count} for {reason}" for reason, count in counts.items())
        console.print(f"  {device}: rejected {reasons}", style="yellow")


def print_safety(console: Console, safety: Mapping[str, Any]) -> None:
    """What soft limits held back, and the fault."""
    held = [f"{name} {count} ticks" for name, count in safety["limited_ticks"].items() if count]
    if held:
        console.print(f"  soft limits held the command back: {', '.join(held)}", style="yellow")
    if safety["fault"]:
        fault = safety["fault"]
        console.print(f"  STOPPED for safety {moment(fault)}: {fault['text']}", style="bold red")
        for text in safety["further_faults"]:
            console.print(f"  also: {text}", style="red")


def print_reproduction(summary: Mapping[str, Any]) -> None:
    """Table I cube by cube, the paper's numbers beside ours, and what became of its claims."""
    console = plain_console()
    for cube in ("soft", "medium", "hard"):
        table = Table(
            title=f"Table I, {cube} cube (paper; * calibrated)",
            title_justify="left",
            box=box.SIMPLE_HEAD,
            title_style="bold",
        )
        for heading in ("", "b [N s/m]", "(paper)", "k [N/m]", "(paper)", "e_f [N]", "(paper)"):
            table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
        for row in summary["trials"]:
            if row["cube"] != cube:
                continue
            paper, mark = row["paper"], "*" if row["calibrated"] else " "
            table.add_row(
                f"{row['condition']} {row['estimator']}",
                number(row["b"], 1) + mark,
                f"({paper['b']:.1f})",
                number(row["k"], 0) + mark,
                f"({number(paper['k'], 0)})",
                number(row["e_f"], 2),
                f"({paper['e_f']:.2f})",
            )
        console.print(table)
    for claim in summary["claims"]:
        style = "green" if claim["holds"] else "yellow"
        console.print("holds:   " if claim["holds"] else "does not:", style=style, end=" ")
        console.print(f"{claim['claim']}\n          {claim['evidence']}")


def print_lag(summary: Mapping[str, Any]) -> None:
    """The lag of a force channel."""
    console = plain_console()
    low, high = summary["lag_low_s"] * 1e3, summary["lag_high_s"] * 1e3
    console.print(
        f"lag {summary['lag_s'] * 1e3:.3f} ms, 95 % interval {low:.3f} to {high:.3f} ms\n"
        f"spring {number(summary['k'], 0)} N/m, residual {summary['rms']:.2g} N rms"
    )
    if "true_lag_s" in summary:
        console.print(f"true lag (simulated) {summary['true_lag_s'] * 1e3:.3f} ms")
    console.print(
        f"take it into account with: teleop estimate FILE --force-lag {summary['lag_s']:.5f}"
    )


def print_tare(tare: Tare, noise: float, path: Path) -> None:
    """The zeros of a rig."""
    plain_console().print(
        f"master force zero {tare.master_force:+.4f} N\n"
        f"contact force zero {tare.contact_force:+.4f} N, noise {noise:.3f} N rms\n"
        f"contact at {tare.slave_position * 1e3:+.4f} mm\n"
        f"{tare.date}: stored in {path}; apply it with: teleop run --tare {path}"
    )
