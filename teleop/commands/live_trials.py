"""Run the trials that a person starts in the live page.

While a function of this file waits for the person, a signal raises KeyboardInterrupt (see
`teleop.interruption.Interruption`), which ends the command.
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
    """Wait for the next request of the page; None if the process that serves it has ended."""
    while link.is_running:
        if request := link.wait_for_request(WAIT):
            return request
    return None


def run_from_page(link: LiveLink, settings: TrialSettings, runner: TrialRunner, once: bool) -> int:
    """Run each trial that the page requests, and return the exit code of the last one.

    `settings` do not contain yet what the pointer needs (`for_pointer`), because this depends on
    the feedback law, which the page can change.

    The function returns after a trial that a signal has ended, when the process that serves the
    page has ended, or, with `once`, after the first trial in which the drives were armed.
    SafetyStop is raised only with `once`; otherwise the page can start another trial. A trial that
    cannot begin now, for example because the machine is busy, does not end the session: the page
    shows the reason, and a person can try again. Settings with which the first trial can never
    begin raise their InputError.
    """
    from drivers import RigError
    from teleop.commands.live_options import for_pointer
    from teleop.errors import InputError, SafetyStop
    from teleop.printable import print_error
    from teleop.trial.rehearsal import TooSlowError

    while True:
        problem = ""
        begun = link.trials
        try:
            code = runner.run(for_pointer(settings))
        except SafetyStop as error:
            if once:
                raise
            print_error(str(error))
            code = 3
        except (InputError, RigError) as error:
            ran = link.trials > begun
            if (once and ran) or not (link.trials or isinstance(error, TooSlowError)):
                raise
            problem, code = str(error), 2
            print_error(problem)
            if not ran:
                link.refuse()
        if runner.interrupted:
            return code or 130
        if once and link.trial and link.trial.armed:
            return code
        following = next_settings(link, settings, problem)
        if following is None:
            print_error(LOST)
            return code
        settings = following


def next_settings(
    link: LiveLink, settings: TrialSettings, problem: str = ""
) -> TrialSettings | None:
    """Wait until NEXT or REPEAT is pressed in the page, and return the settings to run.

    If the last trial ended before a person had started it, a changed setting is returned at once,
    so that the page shows the trial that START would run. None if the live process has ended.
    `problem` is the reason why no trial began, or why its recording is not complete.
    """
    from teleop.errors import InputError

    waiting = not problem and link.trial is not None and not link.trial.armed
    why = problem
    if link.trial and waiting:
        why = link.trial.ticks.events[-1]["text"]
    answers, advice = ("next", "repeat", "notes"), "NEXT prepares another trial"
    link.ask(why, answers, advice)
    while request := next_request(link):
        kind = request["type"]
        if kind == "choose":
            try:
                settings = chosen(settings, request)
            except InputError as error:
                link.refuse()
                link.ask(str(error), answers, f"{advice} with the settings before")
                continue
            if waiting:
                return settings
        elif kind == "notes":
            settings = replace(settings, notes=request["text"])
        elif kind in ("next", "repeat"):
            return settings
    return None


def chosen(settings: TrialSettings, request: dict[str, Any]) -> TrialSettings:
    """The settings, changed by a request of the page, whose values are in the list of choices.

    InputError if the settings do not fit together, for example a feedback law that is not stable.
    """
    from teleop.commands.live_options import for_pointer
    from teleop.settings.feedback_checks import check_feedback

    changes: dict[str, Any] = {
        name: request[name] for name in ("condition", "duration") if name in request
    }
    if settings.custom_condition:  # the only choice
        changes.pop("condition", None)
    elif "specimen" in request and settings.is_simulated:
        changes["cube"] = request["specimen"]
    if "feedback" in request:
        changes["feedback"] = replace(settings.feedback, law=request["feedback"])
    if "estimators" in request:
        changes["estimators"] = tuple(dict.fromkeys(request["estimators"]))
    changed = replace(settings, **changes)
    check_feedback(for_pointer(changed))
    return changed


class PageOfSeries:
    """Asks a person in the live page before and after each of the `count` trials of a series."""

    def __init__(self, link: LiveLink, count: int) -> None:
        self._link = link
        self._count = count

    def ask(self, question: Question) -> tuple[Answer, str]:
        """Ask what to do with a trial; return the answer, and the notes written before it.

        The answer is "quit" if the process that serves the page has ended.
        """
        from teleop.printable import print_error

        previous = question.previous
        returns = f", REPEAT returns to trial {previous.number}" if previous else ""
        choice = f"NEXT {question.running}, SKIP {question.skipping}{returns}."
        notes: list[str] = []
        answers: dict[str, Answer] = {"next": "run", "skip": "skip"}
        if previous:
            answers["repeat"] = "repeat"
        self._link.ask(question.text, (*answers, "notes"), choice)
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
        """Ask for a note on a trial; empty if the person presses NEXT instead."""
        text = f"Note on trial {trial.number}, {trial.label}"
        self._link.ask(text, ("next", "notes"), "NEXT for no note.")
        request = next_request(self._link)
        return str(request["text"]) if request and request["type"] == "notes" else ""
