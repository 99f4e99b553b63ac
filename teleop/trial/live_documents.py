"""Create messages that describe a trial, and the columns of its data, to the live page.

A message is a dictionary, which is sent as JSON.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimation.registry import BUILT_IN
from estimation.transmission import RIGID as UNKNOWN_TRANSMISSION
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.law import STIFF_PRIOR
from teleop.recording.recording import Recording
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import COLUMNS, DROPPED, POINTER
from teleop.trial.recorded_trial import recorded_truth, trial_settings, truth

if TYPE_CHECKING:
    from teleop.trial.trial_result import TrialResult

PLAIN = {
    "rls": "Recursive least squares: the k and b that fit the newest samples best.",
    "ai": "Adaptive identification: k and b change in proportion to the error of their force.",
    "me": "Multi-estimator: of 7913 pairs of k and b, the pair that has predicted the force best.",
}
"""Explanations of the estimators of the paper for a person who does not know them, by name."""
MOST_NAMED = 3
"""Largest number of estimators that the introduction names."""
MEANINGS = {column.name: column.meaning for column in (*COLUMNS, DROPPED, *POINTER)}
OF_ESTIMATOR = {
    "b": "damping",
    "k": "stiffness",
    "b_std": "standard deviation of b",
    "k_std": "standard deviation of k",
    "held": "1 while the estimate is held",
    "misfit": "systematic force error relative to the force",
}
"""Meaning of each column of an estimator, by the end of the column's name."""


def column_documents(units: Mapping[str, str]) -> list[dict[str, str]]:
    """Return the name, unit and meaning of each recorded column.

    The result is for the message `welcome`, which describes the data of a trial to the live page.
    """
    return [{"name": name, "unit": unit, "meaning": meaning(name)} for name, unit in units.items()]


def meaning(name: str) -> str:
    """Return the meaning of the recorded column `name`; an empty text if the name is unknown."""
    if match := re.fullmatch(r"\w+?_(b_std|k_std|held|misfit|b|k)", name):
        return OF_ESTIMATOR[match[1]]
    return MEANINGS.get(name, "")


def trial_document(
    settings: TrialSettings, number: int = 1, position: int = 0, of: int = 0
) -> dict[str, Any]:
    """Return the message `trial`, which the live page receives when a trial starts.

    `glued` is whether the specimen is glued to the slave's plate; None if this is not known.
    """
    limits, target = settings.limits, settings.target
    true = truth(settings, settings.setup.depth) if settings.is_simulated else None
    return {
        "type": "trial",
        "number": number,
        "condition": settings.condition_name,
        "instruction": settings.known_condition.instruction,
        "steps": [step.text for step in settings.protocol.steps] if settings.protocol else [],
        "introduction": introduction(settings),
        "explanations": explanations(settings.estimation_preset.estimators),
        "specimen": settings.palpated,
        "duration": settings.duration,
        "choice": {
            "condition": settings.condition_name,
            "specimen": settings.cube if settings.is_simulated else settings.palpated,
            "duration": settings.duration,
            "feedback": settings.feedback.law,
            "estimators": [*settings.estimation_preset.estimators],
        },
        "depth": settings.depth if settings.rig else settings.setup.depth,
        "rig": settings.rig_name,
        "simulated": settings.is_simulated,
        "limits": {
            "soft_position": list(limits.soft_position),
            "hard_position": list(limits.hard_position),
            "soft_force": limits.soft_force,
            "hard_force": limits.hard_force,
            "max_velocity": limits.max_velocity,
        },
        "truth": true and shown_truth(true),
        "transmission": transmission_document(settings),
        "removed_lost_motion": settings.online_transmission.lost_motion,
        "target": {
            "frequency": target.frequency,
            "depth": target.depth,
            "low": target.position(0.0),
            "count_in": target.count_in,
        }
        if target
        else None,
        "glued": settings.setup.cube.glued if settings.is_simulated else settings.feedback.glued,
        "feedback": feedback_document(settings),
        "operator": settings.operator,
        "series": {"position": position, "of": of} if of else None,
        "station": settings.station.side if settings.station else None,
    }


def result_document(
    found: TrialResult, estimates: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the fields of the message `summary` that the evaluation of a trial gives.

    `shown` contains the texts that `teleop run` and `teleop estimate` print, so that the numbers
    have the same digits everywhere. `estimates` are those of the online estimators at the end.
    """
    from teleop.output.estimate_tables import interval_table
    from teleop.output.result_tables import (  # rich: after the loop
        further_reasons,
        meaning_lines,
        result_values,
        tangent_lines,
        use_text,
    )

    result = found.summary["result"]
    headings, rows = interval_table(estimates)
    where = tangent_lines(result)[:1]
    shown = {
        "use": use_text(result),
        "values": [one._asdict() for one in result_values(result)],
        "meaning": [*where, *meaning_lines(found.summary)],
        "reasons": further_reasons(result),
        "headings": headings,
        "estimates": rows,
    }
    return {**found.summary, "shown": shown, "picture": found.picture}


def recorded_result(recording: Recording, path: Path) -> dict[str, Any]:
    """Return the message `summary` with the result that `teleop estimate` gives for a recording."""
    from teleop.trial.trial_result import trial_result  # imports scipy, which takes long

    found = result_document(trial_result(recording, path), {})
    about = {"recording": {"path": str(path), "problem": None}, "files": {}}
    return {"type": "summary", **about, **found}


def introduction(settings: TrialSettings) -> str:
    """Return a sentence that states what happens in a trial, for a person who sees it first."""
    specimen = f"the simulated {settings.palpated}" if settings.is_simulated else settings.palpated
    names = settings.estimation_preset.estimators
    count = len(names)
    listed = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    methods = listed if count <= MOST_NAMED else f"{count} methods"
    estimated = f"while {methods} estimate{'s' * (count == 1)} its stiffness k and damping b"
    if settings.known_condition.moved_by != "hand":
        return f"the controller moves the tool on {specimen}, {estimated}"
    if settings.operator == "pointer":
        who, verbs = "you", ("press", "follow")
    else:
        simulated = settings.is_simulated
        who = "a simulated operator" if simulated else "the operator"
        verbs = ("presses", "follows")
    if settings.target:
        return f"{who} {verbs[1]} a moving target with the tool on {specimen}, {estimated}"
    return f"{who} {verbs[0]} the tool on {specimen}, {estimated}"


def explanations(names: Sequence[str]) -> dict[str, str]:
    """Return an explanation of each estimator of this package, by its name."""
    texts = {}
    for name in names:
        if name in PLAIN:
            texts[name] = PLAIN[name]
        elif name in BUILT_IN:
            method = getattr(BUILT_IN[name], "__self__", None)
            texts[name] = (method.__doc__ or "").strip().partition("\n")[0]
    return texts


def feedback_document(settings: TrialSettings) -> dict[str, Any] | None:
    """Return the feedback law and the channel of a trial; None if the trial has neither.

    `prior` is the stiffness that the hand feels before the specimen is estimated [N/m]; None if the
    law does not display such a stiffness.
    """
    if not settings.has_link:
        return None
    law, channel = settings.feedback, settings.channel or ChannelSettings()
    prior = law.gain * settings.coupling.scale * STIFF_PRIOR
    return {
        "law": law.law,
        "prior": prior if law.law_type.displays_prior else None,
        "delay": channel.delay,
        "jitter": channel.jitter,
        "loss": channel.loss,
    }


def transmission_document(settings: TrialSettings) -> dict[str, float] | None:
    """Return the lag [s] and the lost motion [m] for which the estimates are not corrected.

    The result is None if the lag is unknown: it was neither measured nor stated.
    """
    measured, online = settings.transmission, settings.online_transmission
    in_rig_file = settings.rig and settings.rig.sections.transmission
    is_measured = bool(in_rig_file) or measured != UNKNOWN_TRANSMISSION
    if not (is_measured or online.force_lag):
        return None
    lag = measured.force_lag - online.force_lag if is_measured else 0.0
    lost = measured.lost_motion - online.lost_motion if measured.lost_motion else 0.0
    return {"force_lag": lag, "lost_motion": lost}


def recorded_document(recording: Recording) -> dict[str, Any]:
    """Return the message `trial`, which describes a recorded trial to the live page.

    The result is an empty dictionary if the settings in the recording are not valid.
    """
    settings = trial_settings(recording)
    if not settings:
        return {}
    true = recorded_truth(recording)
    return trial_document(settings) | {"truth": true and shown_truth(true)}


def shown_truth(true: dict[str, Any]) -> dict[str, float]:
    """Return those true values of a simulated trial that the live page shows.

    These are the stiffness at the surface `k_surface` [N/m], the stiffness at the largest
    displacement `k` [N/m] and the damping `b` [N s/m].
    """
    return {"k_surface": true["k_surface"], "k": true["k_deepest"], "b": true["b"]}
