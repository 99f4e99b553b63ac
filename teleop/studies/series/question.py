"""Create the question that a person is asked before each trial of a series.

The question states which trial is next, whether it was run before, and the effect of each answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from teleop.studies.series.journal import Journal
from teleop.studies.series.plan import Plan
from teleop.studies.series.trials import PlannedTrial

Answer = Literal["run", "skip", "repeat", "quit"]
EFFECTS = {
    "done": ("runs it again", "keeps its result"),
    "skipped": ("runs it", "leaves it skipped"),
}
"""Effects of the answers "run" and "skip" if the trial is already done, or was skipped before."""
EFFECTS_ON_PENDING = ("runs it", "skips it")
"""Effects of the answers "run" and "skip" if the trial is neither done nor skipped."""


@dataclass(frozen=True)
class Question:
    """Question to a person whether to run a trial of a series, with the effects of the answers."""

    trial: PlannedTrial
    """The trial that the answer "run" starts."""
    prompt: str
    """Number of the trial, and the text that the plan contains for the person."""
    state: str
    """Sentence that states what was done in this trial before; empty if it was never run."""
    running: str
    """Effect of the answer "run", such as `runs it again`."""
    skipping: str
    """Effect of the answer "skip", such as `keeps its result`."""
    previous: PlannedTrial | None
    """Trial that the answer "repeat" returns to; None if this trial is the first one."""

    @property
    def text(self) -> str:
        """Text that is shown to the person: `prompt`, and what was done in this trial before."""
        return f"{self.prompt}\n{self.state}" if self.state else self.prompt


def question_on(
    trial: PlannedTrial, plan: Plan, trials: Sequence[PlannedTrial], journal: Journal
) -> Question:
    """Return the question whether to run a trial of a series."""
    last = journal.last(trial.number)
    running, skipping = EFFECTS.get(last["entry"] if last else "", EFFECTS_ON_PENDING)
    return Question(
        trial,
        prompt_of(plan, trial, len(trials)),
        state_of(trial.number, journal),
        running,
        skipping,
        next((other for other in trials if other.number == trial.number - 1), None),
    )


def prompt_of(plan: Plan, trial: PlannedTrial, count: int) -> str:
    """Return a text with the number of a trial, and the prompt of the plan.

    The prompt is a text for the person. It can contain placeholders: {trial} is replaced by the
    name of the trial. The name of a factor in braces, such as {cube}, is replaced by the level of
    this factor in the trial, such as soft.
    """
    text = plan.prompt.replace("{trial}", trial.label)
    for name, level in trial.levels.items():
        text = text.replace(f"{{{name}}}", level)
    return f"trial {trial.number} of {count}: {text}"


def state_of(number: int, journal: Journal) -> str:
    """Return a sentence that states whether a trial is done, was skipped, or must be repeated.

    The result is empty if the trial has neither been started nor skipped yet.
    """
    last, attempt = journal.last(number), journal.attempts(number)
    if last is None:
        return ""
    if last["entry"] == "done":
        return f"Trial {number} is done (attempt {attempt})."
    if last["entry"] == "skipped":
        return f"Trial {number} was skipped."
    return f"Attempt {attempt} of trial {number} must be repeated: {journal.problem(number)}."
