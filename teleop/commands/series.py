"""`teleop series`: run the trials of a plan one after another, and record them in one folder."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from teleop.commands.live_options import NOT_LIVE, Live, LiveOptions
from teleop.commands.options import Json, OutputFile
from teleop.names import RealtimeName

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings
    from teleop.studies.series.plan import Plan
    from teleop.studies.series.question import Answer, Question
    from teleop.studies.series.trials import PlannedTrial
    from teleop.trial.live_link import LiveLink
    from teleop.trial.result import Trial


def series(
    plan: Path,
    /,
    *,
    rig: Path | None = None,
    tare: Path | None = None,
    out: OutputFile = None,
    ask: Annotated[bool | None, Parameter(negative="--no-ask")] = None,
    yes: bool = False,
    dry_run: bool = False,
    json: Json = False,
    live: Live = NOT_LIVE,
) -> int:
    """Run the trials of a plan in random or balanced order, and write a table of the results.

    To resume a series that was interrupted or killed, enter the same command again. A trial that
    was interrupted, or was ended by a safety stop, is run again. Its first recording is kept.

    Example: `teleop series paper --out paper-series`

    Parameters
    ----------
    plan
        File with the plan of the trials (TOML), or the word `paper` for the paper's nine trials.
    rig
        Rig file (TOML) of a hardware rig, or the name of a rig of another package. The trials run
        on this rig, in real time. Default: the rig of the plan, or the simulated rig.
    tare
        File with the zero offsets of the channels of the rig --rig, from `teleop rig tare`.
        Default: the tare of the plan.
    out
        Folder for the recordings, the table trials.csv with a row for each trial and estimator,
        and the journal journal.jsonl. Default: series-NAME, where NAME is the name of the plan.
    ask
        Ask before each trial: Enter runs it, s skips it, r returns to the previous trial to repeat
        it, q quits. Text after s, r or q is stored as a note; after r, it is a note on the previous
        trial. After each trial, ask for a note.
        Default: ask if a trial uses a hardware rig and the command runs in a terminal.
    yes
        Arm the drives of a hardware rig without asking.
    dry_run
        Print the order of the trials, and run none.
    """
    from teleop.commands.live_trials import PageOfSeries
    from teleop.errors import InputError
    from teleop.printable import discard_output
    from teleop.studies.series.conduct import (
        conduct,
        is_complete,
        no_note,
        unattended,
    )
    from teleop.studies.series.trials import read_series
    from teleop.trial.arming import check_person

    options = {"rig": rig, "tare": tare, "out": out, "ask": ask, "no_ask": ask is False}
    resume = resuming_command(plan, options | {"yes": yes, "json": json}, live)
    if tare and not rig:
        raise InputError(
            "--tare: expected also --rig, the rig to which the zero offsets belong; for the rig of "
            "the plan, expected tare in its [settings]"
        )
    read, trials = read_series(plan, rig, tare)
    folder = out or Path(f"series-{read.name}")
    if dry_run:
        print_order(read, trials, json)
        return 0
    all_settings = [trial.settings for trial in trials]
    live = live.requested(all_settings)
    by_page = live.arms(all_settings, yes)
    moving = next((one for one in all_settings if one.needs_arming), None)
    arms = bool(moving) and not (yes or by_page or is_complete(folder, read, trials))
    if moving and arms:
        if ask is False:
            raise InputError("--no-ask: nobody is asked to arm the drives: expected --yes")
        check_person(moving.rig_name)
    asks = arms if ask is None else ask
    before, after = (partial(person, yes=yes), note_of_person) if asks else (unattended, no_note)
    try:
        with live.linked(all_settings, by_page, choose=False) as link:
            if link and by_page:
                page, asks = PageOfSeries(link, len(trials)), False
                before, after = page.ask, page.ask_note
            runner = SeriesRunner(link, explained=asks)
            conduct(folder, read, trials, before, after, runner.run, report, lambda: runner.ended)
    except KeyboardInterrupt:
        try:
            print(file=sys.stderr)  # the terminal has written ^C
            print_end(folder, trials, resume, json)
        except OSError as error:  # the terminal was closed
            discard_output(error)
        raise
    print_end(folder, trials, resume, json)
    return 0


def print_order(plan: Plan, trials: Sequence[PlannedTrial], json: bool) -> None:
    """Print the trials of a plan in their order."""
    from teleop.output.console import plain_console, print_json, print_table

    if json:
        print_json({"trials": [{**trial.levels, "number": trial.number} for trial in trials]})
        return
    headings = ["trial", *plan.factors, "repetition"]
    rows = [[str(trial.number), *trial.levels.values(), str(trial.repetition)] for trial in trials]
    title = f"{plan.name}, {plan.order} order"
    print_table(plain_console(), title, headings, rows, left=1 + len(plan.factors))


def report(text: str) -> None:
    """Print one line of progress, or nothing if the terminal was closed."""
    from teleop.printable import print_error

    with contextlib.suppress(OSError):
        print_error(text)


@dataclass
class SeriesRunner:
    """Runs and records the trials of a series, with a progress line and a stop key."""

    link: LiveLink | None = None
    explained: bool = False
    """Whether the instructions for stopping a hardware rig are shown before a trial."""
    ended: bool = False
    """Whether the series must end, because of a signal during the latest trial."""

    def run(self, settings: TrialSettings, path: Path) -> Trial:
        """Run a trial, and record it to the file `path`.

        Ctrl-C ends the trial only, unless the drives were not armed in this trial.
        """
        from teleop.commands.live_options import for_pointer
        from teleop.trial.run import run_trial
        from teleop.trial.stop_switch import StopSwitch

        real: RealtimeName = "try" if settings.clock == "real" else "off"
        with StopSwitch(key=True, explained=self.explained and settings.needs_arming) as switch:
            trial = run_trial(
                for_pointer(settings),
                path,
                sys.stderr.isatty(),
                switch,
                real,
                live=self.link,
                arm=True,  # `series` has checked that a person, a page or --yes arms the drives
            )
            if self.link:  # a signal during the evaluation does not discard the trial
                self.link.show_result(trial)
        self.ended = switch.ends_command or (switch.signalled and not trial.armed)
        return trial


def person(question: Question, yes: bool = False) -> tuple[Answer, str]:
    """Ask at the terminal what to do with a trial; return the answer, and a note typed after it.

    The answer is "quit" if the input is closed. If nobody can answer, and `yes` does not permit to
    arm the drives of a hardware rig, InputError is raised.
    """
    from teleop.trial.arming import answer, arming_text, check_person

    answers: dict[str, Answer] = {"": "run", "s": "skip", "r": "repeat", "q": "quit"}
    settings, previous = question.trial.settings, question.previous
    armed = f"\n{arming_text(settings)}" if settings.needs_arming else ""
    returns = f"r returns to trial {previous.number}, " if previous else ""
    choice = f"Enter {question.running}, s {question.skipping}, {returns}q quits."
    text = f"{question.text}{armed}\n{choice}"
    while True:
        if settings.needs_arming and not yes:
            check_person(settings.rig_name)
        line = answer(text)
        if line is None:
            return "quit", ""
        letter, _, note = line.strip().partition(" ")
        if letter.lower() in answers:
            return answers[letter.lower()], note
        text = "Expected Enter, s, r or q."


def note_of_person(trial: PlannedTrial) -> str:
    """Ask at the terminal for a note on a trial; empty if there is none."""
    from teleop.trial.arming import answer

    line = answer(f"Note on trial {trial.number}, {trial.label}; Enter for no note.")
    return (line or "").strip()


def resuming_command(plan: Path, options: Mapping[str, Any], live: LiveOptions) -> list[str]:
    """The words of the command with the options that were given (neither None nor False)."""
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

    Nothing is printed if the series has not begun.
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
