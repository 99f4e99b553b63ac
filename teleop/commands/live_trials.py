"""Run the trials that a person starts in the live page, a web page that controls the trials.

While a function of this file waits for the person, a signal such as Ctrl-C raises KeyboardInterrupt
(see `teleop.interruption.Interruption`), which ends the command.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from teleop.commands.one_trial import TrialRunner
    from teleop.settings.trial_settings import TrialSettings
    from teleop.studies.series.question import Answer, Question
    from teleop.studies.series.trials import PlannedTrial
    from teleop.trial.live_link import LiveLink

WAIT = 0.2
"""Time between two checks whether the live process is running [s]."""
LOST = "the live process, which serves the page, has ended or does not respond"


def next_request(link: LiveLink) -> dict[str, Any] | None:
    """Wait for the next request of the live page, such as the button NEXT, and return it.

    Parameters
    ----------
    link
        Connection to the live page, the web page in which a person controls the trials.

    Returns
    -------
    The request; None if the process that serves the live page has ended.
    """
    while link.is_running:
        if request := link.wait_for_request(WAIT):
            return request
    return None


def run_from_page(link: LiveLink, settings: TrialSettings, runner: TrialRunner, once: bool) -> int:
    """Run each trial that the live page requests, and return the exit code of the last trial.

    The function returns after a trial that a signal such as Ctrl-C has ended, or when the process
    that serves the live page has ended.

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
    KeyboardInterrupt
        A signal such as Ctrl-C arrived between two trials.
    """
    from teleop.errors import SafetyStop
    from teleop.printable import print_error

    while True:
        try:
            code = runner.run(settings)
        except SafetyStop as error:
            if once:
                raise
            print_error(str(error))
            code = 3
        if runner.interrupted:
            return code or 130
        if once and link.trial and link.trial.armed:
            return code
        following = next_settings(link, settings)
        if following is None:
            print_error(LOST)
            return code
        settings = following


def next_settings(link: LiveLink, settings: TrialSettings) -> TrialSettings | None:
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

    Returns
    -------
    The settings; None if the process that serves the live page has ended.
    """
    waiting = link.trial is not None and not link.trial.armed
    why = f"{link.trial.ticks.events[-1]['text']}; " if link.trial and waiting else ""
    link.ask(f"{why}NEXT prepares another trial", ("next", "repeat", "notes"))
    while request := next_request(link):
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

    def ask(self, question: Question) -> tuple[Answer, str]:
        """Ask the person in the live page whether to run a trial, and wait for the answer.

        Parameters
        ----------
        question
            The question, with the trial that is next.

        Returns
        -------
        answer
            "run"; "skip"; "repeat" to return to the previous trial; or "quit" if the process that
            serves the live page has ended.
        note
            Notes that the person wrote before the answer; empty if there are none.
        """
        from teleop.printable import print_error

        previous = question.previous
        returns = f", REPEAT returns to trial {previous.number}" if previous else ""
        choice = f"NEXT {question.running}, SKIP {question.skipping}{returns}."
        notes: list[str] = []
        answers: dict[str, Answer] = {"next": "run", "skip": "skip"}
        if previous:
            answers["repeat"] = "repeat"
        self._link.ask(f"{question.text}\n{choice}", (*answers, "notes"))
        while request := next_request(self._link):
            if request["type"] in answers:
                answer = answers[request["type"]]
                if answer == "run" or not self._link.position:
                    self._link.position, self._link.of = question.trial.number, self._count
                return answer, "; ".join(notes)
            if request["type"] == "notes":
                notes.append(request["text"])
        print_error(LOST)
        return "quit", "; ".join(notes)

    def ask_note(self, trial: PlannedTrial) -> str:
        """Ask the person in the live page for a note on a trial that has ended, and return it.

        The note is empty if the person presses the button NEXT instead.
        """
        text = f"Note on trial {trial.number}, {trial.label}; NEXT for no note."
        self._link.ask(text, ("next", "notes"))
        request = next_request(self._link)
        return str(request["text"]) if request and request["type"] == "notes" else ""
