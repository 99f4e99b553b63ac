"""Print the numbers of finished and pending trials of a series, and the commands to type next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop.commands.live_options import NOT_LIVE, LiveOptions

if TYPE_CHECKING:
    from teleop.studies.series.trials import PlannedTrial


def resuming_command(plan: Path, options: Mapping[str, Any], live: LiveOptions) -> list[str]:
    """Return the command that resumes a series, as a list of words.

    It is the command with which the series was started.

    Parameters
    ----------
    plan
        File with the plan of the trials.
    options
        Value of each option of the command, by name. The value is None or False if the option was
        not given.
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
    """Print how many trials are done, skipped and pending, and the commands to type next.

    If trials are pending, the command that resumes the series is printed. If at least one trial is
    done, the command that makes the table and the figure of the series is printed.

    Parameters
    ----------
    folder
        Folder of the series. If the series has not begun, nothing is printed.
    trials
        The trials of the plan.
    resume
        Words of the command that resumes the series.
    json
        Whether to print one JSON document, without commands, instead of lines of text.
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
