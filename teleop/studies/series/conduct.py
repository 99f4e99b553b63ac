"""Run and record the trials of a series, and repeat failed trials until all trials are done."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from drivers import RigError
from teleop.errors import InputError, SafetyStop
from teleop.files import make_folder
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.json_lines import LOCK, locked
from teleop.studies.series.journal import INTERRUPTED, NAME, RECORDINGS, Journal
from teleop.studies.series.plan import Plan
from teleop.studies.series.question import Answer, Question, question_on, state_of
from teleop.studies.series.table import write_results
from teleop.studies.series.trials import PlannedTrial
from teleop.trial.result import Trial
from teleop.trial.run import run_trial

Ask = Callable[[Question], tuple[Answer, str]]
"""Function that asks a person whether to run a trial. It returns the answer and a note."""
AskNote = Callable[[PlannedTrial], str]
"""Function that asks a person for a note on a trial that has ended. It returns an empty text if
there is no note."""
Run = Callable[[TrialSettings, Path], Trial]
"""Function that runs and records a trial."""
ATTEMPTS = 3
"""Number of failed attempts of one trial after which an unattended series ends with an error. In an
unattended series, no person is asked before a trial."""


def unattended(question: Question) -> tuple[Answer, str]:
    """Answer "run" without asking a person."""
    return "run", ""


def no_note(trial: PlannedTrial) -> str:
    """Return an empty note without asking a person."""
    return ""


def open_journal(folder: Path, plan: Plan, trials: Sequence[PlannedTrial]) -> Journal:
    """Open the journal of a series, new or resumed; a new one begins with the plan."""
    journal = Journal(folder)
    document = plan.model_dump(mode="json")
    known = next((entry["plan"] for entry in journal.entries if entry["entry"] == "plan"), None)
    if known is None:
        if any(path.name not in (LOCK, NAME) for path in folder.iterdir()):
            raise InputError(f"{folder}: expected an empty folder, or the folder of a series")
        journal.write("plan", plan=document, order=[trial.label for trial in trials])
    elif known != document:
        raise InputError(f"{folder}: contains a series of another plan: expected a new folder")
    for entry in journal.entries:
        if entry["trial"] > len(trials):
            raise InputError(
                f"{folder / NAME}: contains trial {entry['trial']}: expected at most {len(trials)}"
            )
    return journal


def conduct(
    folder: Path,
    plan: Plan,
    trials: Sequence[PlannedTrial],
    ask: Ask = unattended,
    ask_note: AskNote = no_note,
    run: Run = run_trial,
    report: Callable[[str], None] = print,
    is_ended: Callable[[], bool] = lambda: False,
) -> Journal:
    """Run the trials of a series that are not done yet, and return the journal of the series.

    A trial is repeated if it was stopped for safety, interrupted, or recorded incompletely; the
    recording of the failed attempt is kept. If a trial cannot be run at all, for example because
    the rig cannot be opened, it is proposed to the person again. An unattended series then ends
    with the InputError or RigError. It also ends with the problem of a trial that failed `ATTEMPTS`
    times, and at an interrupted trial. `is_ended` states that the series must end after the present
    trial, for example because the terminal was closed; a KeyboardInterrupt follows, and nobody is
    asked.
    """
    make_folder(folder / NAME)
    with locked(folder):
        journal = open_journal(folder, plan, trials)
        write_results(folder, trials, journal)
        if any(journal.attempts(trial.number) or journal.last(trial.number) for trial in trials):
            report(resumed_text(folder, trials, journal))
        returned: PlannedTrial | None = None
        rested = -math.inf
        while trial := returned or next(
            (t for t in trials if not journal.is_finished(t.number)), None
        ):
            time.sleep(max(rested + plan.rest_s - time.monotonic(), 0.0))
            question = question_on(trial, plan, trials, journal)
            answer, note = ask(question)
            returned = None
            write_answer(journal, question, trial, answer, note)
            if answer != "run":
                write_results(folder, trials, journal)
            if answer == "quit":
                break
            if answer == "repeat":  # its prompt states what is armed
                if question.previous is None:
                    report("there is no trial before the first one: expected Enter, s or q")
                returned = question.previous or trial
            if answer != "run":
                continue
            was_run = True
            try:
                problem = attempt(folder, journal, trial, run, note)
            except (InputError, RigError) as error:
                if ask is unattended:
                    raise
                problem, was_run = error, False
            write_results(folder, trials, journal)
            rested = time.monotonic()
            again = "; the same trial is next" if problem and ask is not unattended else ""
            report(f"{trial.number} of {len(trials)}, {trial.label}: {problem or 'done'}{again}")
            if is_ended():
                raise KeyboardInterrupt
            if was_run and (after := ask_note(trial)):
                attempts = journal.attempts(trial.number)
                journal.write("note", trial.number, attempt=attempts, note=after)
                write_results(folder, trials, journal)
            if problem and ask is unattended:
                if isinstance(problem, KeyboardInterrupt):
                    raise problem
                if journal.attempts(trial.number) >= ATTEMPTS:
                    raise type(problem)(f"trial {trial.number}, {trial.label}: {problem}")
    return journal


def write_answer(
    journal: Journal, question: Question, trial: PlannedTrial, answer: Answer, note: str
) -> None:
    """Write to the journal that a person skips a trial, or the note of another answer than run."""
    if answer == "skip" and not journal.is_finished(trial.number):
        journal.write("skipped", trial.number, note=note)
    elif answer != "run" and note:
        about = question.previous or trial if answer == "repeat" else trial
        attempts = journal.attempts(about.number)
        journal.write("note", about.number, attempt=attempts, answer=answer, note=note)


def attempt(
    folder: Path, journal: Journal, trial: PlannedTrial, run: Run, note: str
) -> BaseException | None:
    """Run a trial once, and return the reason why it must be repeated; None after success."""
    number = journal.attempts(trial.number) + 1
    path = folder / RECORDINGS / f"{trial.number:03d}-{trial.label}-{number}.mcap"
    make_folder(path)
    journal.write("started", trial.number, attempt=number, file=path.name, note=note)
    try:
        result = run(trial.settings, path)
    except (InputError, RigError) as error:
        journal.write("spoilt", trial.number, attempt=number, problem=str(error))
        raise
    problem = spoilt(result)
    if problem is None:
        summary = result.summary()
        result_of = {"file": path.name, "size": path.stat().st_size, "summary": summary}
        journal.write("done", trial.number, attempt=number, **result_of)
        return None
    about = {"attempt": number, "file": path.name, "problem": str(problem)}
    try:
        journal.write("spoilt", trial.number, **about)
    except InputError as error:
        if isinstance(problem, SafetyStop):  # the full disk does not hide the safety stop
            raise SafetyStop(f"{problem}; {error}") from error
        raise
    if isinstance(problem, InputError) and result.outcome.problem:
        raise problem  # another attempt would not be recorded either
    return problem


def spoilt(trial: Trial) -> BaseException | None:
    """Return why a trial that has ended must be repeated; None after success."""
    if trial.fault:
        return SafetyStop(trial.stop_text)
    if trial.interrupted:
        return KeyboardInterrupt(INTERRUPTED)
    return InputError(trial.incomplete) if trial.incomplete else None


def resumed_text(folder: Path, trials: Sequence[PlannedTrial], journal: Journal) -> str:
    """Return a text on the state of a series that is resumed."""
    found = counts(journal, trials)
    if not found["pending"]:
        return f"{folder}: the series is complete, no trial is run"
    pending = (trial.number for trial in trials if not journal.is_finished(trial.number))
    failed = " ".join(filter(None, (state_of(number, journal) for number in pending)))
    return (
        f"{folder}: the series is resumed: {found['done']} of {len(trials)} trials are done, "
        f"{found['skipped']} skipped{'. ' if failed else ''}{failed}"
    )


def is_complete(folder: Path, plan: Plan, trials: Sequence[PlannedTrial]) -> bool:
    """Return whether all trials of a series are done or skipped; False for a new folder."""
    if not (folder / NAME).is_file():
        return False
    with locked(folder):
        return not counts(open_journal(folder, plan, trials), trials)["pending"]


def counts(journal: Journal, trials: Sequence[PlannedTrial]) -> dict[str, Any]:
    """Return the numbers of trials with the state `done`, `skipped` and `pending` (to be run)."""
    last = [journal.last(trial.number) for trial in trials]
    done = sum(entry is not None and entry["entry"] == "done" for entry in last)
    skipped = sum(entry is not None and entry["entry"] == "skipped" for entry in last)
    return {"done": done, "skipped": skipped, "pending": len(trials) - done - skipped}
