"""Run the trials that a person starts in the live page, a web page that controls the trials."""

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
"""Time between two checks whether the command must end [s]."""


def next_request(link: LiveLink, stopped: Callable[[], bool]) -> dict[str, Any] | None:
    """Wait for the next request of the live page, such as the button NEXT, and return it.

    Parameters
    ----------
    link
        Connection to the live page, the web page in which a person controls the trials.
    stopped
        Function that returns whether a signal such as Ctrl-C has arrived.

    Returns
    -------
    The request; None after a signal, or if the process that serves the live page has ended.
    """
    while link.is_running and not stopped():
        if request := link.wait_for_request(WAIT):
            return request
    return None


def run_from_page(link: LiveLink, settings: TrialSettings, runner: TrialRunner, once: bool) -> int:
    """Run each trial that the live page requests, and return the exit code of the last trial.

    The function returns after a signal such as Ctrl-C, or when the process that serves the live
    page has ended.

    Parameters
    ----------
    link
        Connection to the live page, the web page in which a person controls the trials.
    settings
        Settings of the first trial.
    runner
        Object that runs a trial and writes its outputs.
    once
        Whether to return after the first trial in which the drives were armed (permitted to move).

    Raises
    ------
    SafetyStop
        A fault stopped a trial, and `once` is True.
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
    """Wait for requests of the live page, and return the settings of the next trial.

    The settings are returned when a person presses the button NEXT or REPEAT in the page. There is
    one exception. If the last trial ended before a person had started it, and the person changes a
    setting, the changed settings are returned at once.

    Parameters
    ----------
    link
        Connection to the live page, the web page in which a person controls the trials.
    settings
        Settings of the last trial.
    stopped
        Function that returns whether a signal such as Ctrl-C has arrived.

    Returns
    -------
    The settings; None after a signal, or if the process that serves the live page has ended.
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
    """Return the settings of a trial, changed by a request of the live page (a web page).

    Parameters
    ----------
    settings
        Settings before the change.
    request
        The request. It contains the new values, which are already checked, for `condition`,
        `specimen` and `duration` [s], or for some of them.
    """
    changes: dict[str, Any] = {
        name: request[name] for name in ("condition", "duration") if name in request
    }
    if "specimen" in request and not settings.rig:
        changes["cube"] = request["specimen"]
    return replace(settings, **changes)


class PageOfSeries:
    """Asks a person in the live page, a web page, before and after each trial of a series.

    Before a trial, the question is whether to run the trial. After a trial, the person can write a
    note on the trial.

    Parameters
    ----------
    link
        Connection to the live page, the web page in which a person controls the trials.
    count
        Number of trials in the series.
    """

    def __init__(self, link: LiveLink, count: int) -> None:
        self._link = link
        self._count = count
        self._pending: dict[str, Any] | None = None
        """Request that `ask_note` has received, and that is the answer to the next question."""

    def ask(self, question: Question) -> tuple[Answer, str]:
        """Ask the person in the live page whether to run a trial, and wait for the answer.

        Parameters
        ----------
        question
            The question, with the trial that is next.

        Returns
        -------
        answer
            "run"; "skip"; "repeat" to return to the previous trial; or "quit" after a signal such
            as Ctrl-C, or if the process that serves the live page has ended.
        note
            Notes that the person wrote before the answer; empty if there are none.
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
        """Ask the person in the live page for a note on a trial that has ended, and return it.

        The note is empty if the person presses the button NEXT, REPEAT or SKIP instead. This button
        is then also the answer to the next question, see `ask`. After a signal such as Ctrl-C, the
        note is empty, too.
        """
        from teleop.interruption import stop_signals

        text = f"Note on trial {trial.number}, {trial.label}; NEXT for no note."
        self._link.tell({"type": "prompt", "text": text})
        with stop_signals() as stopped:
            request = next_request(self._link, stopped)
        if request and request["type"] == "notes":
            return str(request["text"])
        self._pending = request
        return ""
