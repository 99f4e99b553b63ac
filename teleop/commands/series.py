"""`teleop series`: run the trials of a plan one after another, and record them in one folder."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop.commands.live_options import NOT_LIVE, Live
from teleop.names import RealtimeName

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings
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
    out: Path | None = None,
    ask: bool | None = None,
    yes: Annotated[bool, Parameter(negative="")] = False,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
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
        Rig file (TOML) of a hardware rig. The trials run on this rig, in real time. Default: the
        rig of the plan, or the simulated rig.
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
    json
        Print one JSON document instead of lines.
    """
    from teleop.commands.live_trials import PageOfSeries
    from teleop.commands.series_end import print_end, resuming_command
    from teleop.errors import InputError
    from teleop.output.console import plain_console, print_json, print_table
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
    if dry_run and json:
        print_json({"trials": [{**trial.levels, "number": trial.number} for trial in trials]})
        return 0
    if dry_run:
        headings = ["trial", *read.factors, "repetition"]
        rows = [
            [str(trial.number), *trial.levels.values(), str(trial.repetition)] for trial in trials
        ]
        title = f"{read.name}, {read.order} order"
        print_table(plain_console(), title, headings, rows, left=1 + len(read.factors))
        return 0
    all_settings = [trial.settings for trial in trials]
    live = live.requested(all_settings)
    by_page = live.arms(all_settings, yes)
    rig_file = next((one.rig for one in all_settings if one.rig), None)
    arms = bool(rig_file) and not (yes or by_page or is_complete(folder, read, trials))
    if rig_file and arms:
        if ask is False:
            raise InputError("--no-ask: nobody is asked to arm the drives: expected --yes")
        check_person(rig_file)
    asks = arms if ask is None else ask
    before, after = (partial(person, yes=yes), note_of_person) if asks else (unattended, no_note)
    try:
        with live.linked(all_settings, by_page, choose=False) as link:
            if link and by_page:
                page, asks = PageOfSeries(link, len(trials)), False
                before, after = page.ask, page.ask_note
            runner = SeriesRunner(link, explained=asks)
            is_ended = runner.is_ended
            conduct(folder, read, trials, before, after, runner.run, report, is_ended)
    except KeyboardInterrupt:
        try:
            print(file=sys.stderr)  # the terminal has written ^C
            print_end(folder, trials, resume, json)
        except OSError as error:  # the terminal was closed
            discard_output(error)
        raise
    print_end(folder, trials, resume, json)
    return 0


def report(text: str) -> None:
    """Print one line of progress. Nothing is printed if the terminal was closed."""
    from teleop.printable import print_error

    with contextlib.suppress(OSError):
        print_error(text)


@dataclass
class SeriesRunner:
    """Runs and records the trials of a series.

    A progress line is shown in the terminal, and Enter or Space in the terminal stops the drives.
    """

    link: LiveLink | None = None
    """Connection to the live page in a browser; None for no live page."""
    explained: bool = False
    """Whether the instructions for stopping a hardware rig are shown to a person before a trial."""
    ended: bool = False
    """Whether the series must end, because of a signal during the latest trial."""

    def is_ended(self) -> bool:
        """Return the attribute `ended`."""
        return self.ended

    def run(self, settings: TrialSettings, path: Path) -> Trial:
        """Run a trial, and record it to the file `path`.

        After the trial, the series must end if the terminal was closed, or after a signal other
        than Ctrl-C. Ctrl-C ends the trial only, unless the drives were not armed in this trial.
        """
        from teleop.trial.run import run_trial
        from teleop.trial.stop_switch import StopSwitch

        real: RealtimeName = "try" if settings.clock == "real" else "off"
        with StopSwitch(key=True, explained=self.explained and bool(settings.rig)) as switch:
            trial = run_trial(
                settings,
                path,
                sys.stderr.isatty(),
                switch,
                real,
                live=self.link,
                arm=True,  # `series` has checked that a person, a page or --yes arms the drives
            )
        self.ended = switch.ends_command or (switch.signalled and not trial.armed)
        if self.link:
            self.link.show_result(trial)
        return trial


def person(question: Question, yes: bool = False) -> tuple[Answer, str]:
    """Ask a person whether to run or skip a trial, to return to the previous trial, or to quit.

    Parameters
    ----------
    question
        The trial and the texts of the question.
    yes
        Whether the drives of a hardware rig are armed even if nobody can answer at the terminal.

    Returns
    -------
    answer
        "run", "skip", "repeat" (return to the previous trial) or "quit". If the input is closed,
        the answer is "quit".
    note
        Text that the person typed after the letter of the answer; empty if there is none.

    Raises
    ------
    InputError
        The answer "run" would arm a hardware rig, but nobody can answer, see `check_person`.
    """
    answers: dict[str, Answer] = {"": "run", "s": "skip", "r": "repeat", "q": "quit"}
    from teleop.trial.arming import answer, arming_text, check_person

    settings, previous = question.trial.settings, question.previous
    armed = f"\n{arming_text(settings)}" if settings.rig else ""
    returns = f"r returns to trial {previous.number}, " if previous else ""
    choice = f"Enter {question.running}, s {question.skipping}, {returns}q quits."
    text = f"{question.text}{armed}\n{choice}"
    while True:
        if settings.rig and not yes:
            check_person(settings.rig)
        line = answer(text)
        if line is None:
            return "quit", ""
        letter, _, note = line.strip().partition(" ")
        if letter.lower() in answers:
            return answers[letter.lower()], note
        text = "Expected Enter, s, r or q."


def note_of_person(trial: PlannedTrial) -> str:
    """Ask a person for a note on a trial, and return it.

    The note is empty if the person types nothing, or if the input is closed.
    """
    from teleop.trial.arming import answer

    line = answer(f"Note on trial {trial.number}, {trial.label}; Enter for no note.")
    return (line or "").strip()
