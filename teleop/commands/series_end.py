"""Print the result of `teleop series` at its end, with the command that resumes the series."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop.commands.live_options import NOT_LIVE, LiveOptions

if TYPE_CHECKING:
    from teleop.studies.series.trials import PlannedTrial


def resuming_command(plan: Path, options: Mapping[str, Any], live: LiveOptions) -> list[str]:
    """Return the words of the command that resumes a series.

    The series was started with the same command.

    Parameters
    ----------
    plan
        The plan.
    options
        Values of the options by name. An option that was not given has the value None or False.
    live
        Options of the live page.
    """
    defaults = asdict(NOT_LIVE)
    changed = {name: value for name, value in asdict(live).items() if value != defaults[name]}
    words = ["teleop", "series", str(plan)]
    for name, value in {**options, **changed}.items():
        if value is not None and value is not False:
            words.append(f"--{name.replace('_', '-')}")
            words += [] if value is True else [str(value)]
    return words


def print_end(
    folder: Path, trials: Sequence[PlannedTrial], resume: Sequence[str], json: bool
) -> None:
    """Print the numbers of trials that are done, skipped and pending, and the next commands.

    If trials are pending, `resume` is printed. If a trial is done, the command for the table and
    the figure is printed.

    Parameters
    ----------
    folder
        Folder of the series. Nothing is printed if the series has not begun.
    trials
        The trials of the plan.
    resume
        The command that resumes the series.
    json
        Whether to print one JSON document instead of lines.
    """
    from teleop.output.console import plain_console, print_json
    from teleop.output.next_command import print_command
    from teleop.studies.series.conduct import counts
    from teleop.studies.series.journal import NAME, Journal

    if not (folder / NAME).is_file():
        return
    summary = {"folder": str(folder), **counts(Journal(folder), trials)}
    if json:
        print_json(summary)
        return
    plain_console().print(
        f"{folder}: {summary['done']} of {len(trials)} trials done, {summary['skipped']} "
        f"skipped, {summary['pending']} pending"
    )
    if summary["pending"]:
        print_command("resume with", resume)
    if summary["done"]:
        table, figure = str(folder / "table.tex"), str(folder / "figure.pdf")
        command = ["teleop", "compare", str(folder), "--out", table, "--plot", figure]
        print_command("table and figure", command)
