"""Run the trials that a person starts from the live page, one after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from teleop.commands.one_trial import TrialRunner
    from teleop.studies.series.question import Answer, Question
    from teleop.studies.series.trials import PlannedTrial
    from teleop.trial.live_link import LiveLink
    from teleop.trial.settings import TrialSettings

WAIT = 0.2
"""Time between two checks of whether the session must end [s]."""


def next_request(link: LiveLink, stopped: Callable[[], bool]) -> dict[str, Any] | None:
    """Wait for the next request from the live page. Return it, or None if the session must end."""
    while link.is_running and not stopped():
        if request := link.wait_for_request(WAIT):
            return request
    return None


def run_from_page(link: LiveLink, settings: TrialSettings, runner: TrialRunner, once: bool) -> int:
    """Run each trial that the live page requests, and return the exit code of the last trial.

    The function ends after a signal such as Ctrl-C, or when the live process ends.

    Parameters
    ----------
    link
        Link to the live page.
    settings
        Settings of the first trial.
    runner
        Object that runs a trial and writes its outputs.
    once
        Whether to end after the first trial in which the drives were armed.
    """
    from teleop.errors import SafetyStop
    from teleop.interruption import stop_signals
    from teleop.printable import print_error

    while True:
        try:
            code = runner.run(settings)
        except SafetyStop as error:
            if once:
                raise
            print_error(str(error))
            code = 3
        if runner.interrupted or (once and link.trial and link.trial.armed):
            return code
        with stop_signals() as stopped:
            following = next_settings(link, settings, stopped)
        if following is None:
            if not link.is_running:
                print_error("the live process has ended")
            return code
        settings = following


def next_settings(
    link: LiveLink, settings: TrialSettings, stopped: Callable[[], bool]
) -> TrialSettings | None:
    """Wait for a request from the live page, and return the settings of the next trial.

    If the page changes the settings of a trial that still waits for START, the changed settings
    are returned at once. The result is None if the session must end.
    """
    waiting = link.trial is not None and not link.trial.armed
    why = f"{link.trial.ticks.events[-1]['text']}; " if link.trial and waiting else ""
    link.tell({"type": "prompt", "text": f"{why}NEXT prepares another trial"})
    while request := next_request(link, stopped):
        kind = request["type"]
        if kind == "choose":
            settings = chosen(settings, request)
            if waiting:
                return settings
        elif kind == "notes":
            settings = replace(settings, notes=request["text"])
        elif kind in ("next", "repeat"):
            return settings
    return None


def chosen(settings: TrialSettings, request: dict[str, Any]) -> TrialSettings:
    """Return the settings with the values from the live page, which have been checked before."""
    changes: dict[str, Any] = {
        name: request[name] for name in ("condition", "duration") if name in request
    }
    if "specimen" in request and not settings.rig:
        changes["cube"] = request["specimen"]
    return replace(settings, **changes)


class PageOfSeries:
    """Asks the person at the live page what to do before each trial, and for a note afterwards.

    Parameters
    ----------
    link
        Link to the live page.
    count
        Number of trials in the series.
    """

    def __init__(self, link: LiveLink, count: int) -> None:
        self._link = link
        self._count = count
        self._pending: dict[str, Any] | None = None

    def ask(self, question: Question) -> tuple[Answer, str]:
        """Return the answer of the person (run, skip or repeat), and a note.

        The answer is "quit" if the session must end.
        """
        from teleop.interruption import stop_signals

        previous = question.previous
        returns = f", REPEAT returns to trial {previous.number}" if previous else ""
        choice = f"NEXT {question.running}, SKIP {question.skipping}{returns}."
        self._link.tell({"type": "prompt", "text": f"{question.text}\n{choice}"})
        notes: list[str] = []
        answers: dict[str, Answer] = {"next": "run", "repeat": "repeat", "skip": "skip"}
        with stop_signals() as stopped:
            while request := self._pending or next_request(self._link, stopped):
                self._pending = None
                if request["type"] in answers:
                    answer = answers[request["type"]]
                    if answer == "run" or not self._link.position:
                        self._link.position, self._link.of = question.trial.number, self._count
                    return answer, "; ".join(notes)
                if request["type"] == "notes":
                    notes.append(request["text"])
        return "quit", "; ".join(notes)

    def ask_note(self, trial: PlannedTrial) -> str:
        """Return the note on a trial; empty if the person continues without a note."""
        from teleop.interruption import stop_signals

        text = f"Note on trial {trial.number}, {trial.label}; NEXT for no note."
        self._link.tell({"type": "prompt", "text": text})
        with stop_signals() as stopped:
            request = next_request(self._link, stopped)
        if request and request["type"] == "notes":
            return str(request["text"])
        self._pending = request
        return ""
