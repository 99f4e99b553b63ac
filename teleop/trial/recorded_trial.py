"""Compute from a recorded trial and its settings: averaged part, motion, tracking, true values."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from estimation.transmission import RIGID, TransmissionCalibration
from sim_backend import Law, Setup
from teleop.control.phases import Oscillate
from teleop.errors import InputError
from teleop.evaluation.reading.recorded import Last, recorded_settings
from teleop.evaluation.settings import WHOLE, AveragedPart, EstimateSettings
from teleop.evaluation.teleoperation.tracking import Tracking, tracking
from teleop.recording.recording import Recording, load
from teleop.recording.recording_file import RecordingFile
from teleop.settings.documents import from_document
from teleop.settings.trial_settings import TrialSettings


def trial_settings(recording: Recording) -> TrialSettings | None:
    """Return the settings of a recorded trial; None if it has none, or if they are not valid."""
    try:
        return from_document(recording.settings) if recording.settings else None
    except InputError:
        return None


def averaged_part(recording: Recording | RecordingFile, settings: TrialSettings) -> AveragedPart:
    """Return the part of a recorded trial over which the estimates are averaged."""
    part = AveragedPart(*settings.known_condition.averaged_times(settings.intended_motion))
    if settings.target and "target" not in recording.units:
        part = WHOLE  # recorded by a version whose target had no count-in
    armed = next((event["time"] for event in recording.events if event["mode"] == "active"), 0.0)
    return part.after(armed)


def recorded_part(recording: Recording) -> AveragedPart:
    """Return `averaged_part` for the settings in a recording; the whole trial without settings."""
    settings = trial_settings(recording)
    return averaged_part(recording, settings) if settings else WHOLE


def recorded_transmission(recording: Recording) -> TransmissionCalibration:
    """Return the transmission that corrects the result of a recorded trial; `RIGID` if unknown.

    Lag and lost motion are those of the rig, or else those that the settings of the trial state.
    """
    settings = trial_settings(recording)
    if not settings:
        return RIGID
    known, stated = settings.transmission, settings.online_transmission
    return replace(
        known,
        force_lag=known.force_lag or stated.force_lag,
        lost_motion=known.lost_motion or stated.lost_motion,
    )


def estimate_settings(recording: Recording) -> EstimateSettings:
    """Return the settings with which a recorded trial is evaluated, if nobody changes them."""
    return replace(
        recorded_settings(recording),
        averaged=recorded_part(recording),
        transmission=recorded_transmission(recording),
    )


def performed(settings: TrialSettings) -> dict[str, str]:
    """Return texts by name that describe the motion in a trial, including default values."""
    texts = settings.known_condition.motion_texts(settings.intended_motion)
    for part in (settings.custom_condition, settings.custom_signal, settings.custom_link):
        if part:
            texts |= {name: f"{value}" for name, value in part.parameters.items()}
    return texts


def recorded_motion(recording: Recording) -> dict[str, str]:
    """Return `performed` for the settings in a recording; no text without settings."""
    settings = trial_settings(recording)
    return performed(settings) if settings else {}


def tracking_of(recording: Recording, settings: TrialSettings) -> Tracking | None:
    """Return how well the slave followed the target.

    The result is None if the condition or the recording has no target, or if the target moved for
    too few periods (`FEWEST` in `teleop.evaluation.teleoperation.tracking`).
    """
    target_motion = settings.target
    if target_motion is None or "target" not in recording.columns:
        return None
    t, target, position = (recording[name] for name in ("time", "target", "slave_position"))
    return tracking(t, target, position, target_motion.frequency)


def tracked_ticks(ticks: Recording | RecordingFile) -> Recording:
    """Return the ticks for `tracking_of`: all in memory, or the last ones of a long recording."""
    if isinstance(ticks, Recording):
        return ticks
    names = [name for name in ("time", "target", "slave_position") if name in ticks.units]
    last = Last()
    for block in ticks.blocks(names.__contains__):
        last.add(block.columns)
    return Recording(last.columns(names), ticks.units)


def recorded_tracking(recording: Recording) -> Tracking | None:
    """Return `tracking_of` for the settings in a recording; None without settings."""
    settings = trial_settings(recording)
    return tracking_of(recording, settings) if settings else None


def recorded_steps(recording: Recording, path: Path | None) -> list[dict[str, Any]]:
    """Return the results of the steps of a recorded protocol; empty for another trial.

    All samples are read from the file `path`, because `recording` may have some of them only.
    """
    settings = trial_settings(recording)
    if not (settings and settings.protocol):
        return []
    from teleop.evaluation.protocol.steps import StepPart, step_results  # imports scipy

    if path:
        recording = load(path, OF_STEPS.__contains__)
    steps = [
        StepPart(
            step.phase,
            step.kind,
            step.text,
            step.by,
            step.tones[0][0] if isinstance(step, Oscillate) else math.nan,
        )
        for step in settings.protocol.steps
    ]
    new = np.isfinite(recording["paired_force"])
    t, x, f, number = (recording[name][new] for name in OF_STEPS)
    known, resolution = recorded_transmission(recording), settings.encoder_resolution
    return step_results(t, x, f, number, steps, known, resolution)


def with_steps(
    document: dict[str, Any], recording: Recording | None, path: Path | None
) -> dict[str, Any]:
    """Return the document of an evaluation with the results of the steps of a protocol.

    The whole record of a protocol needs no k and b. Reasons against them would name faults of a
    palpation that a protocol has on purpose, such as a force that does not change.
    """
    steps = recorded_steps(recording, path) if recording else []
    result = document.get("result")
    if steps and result and not result["identifiable"]:
        document = {**document, "result": {**result, "reasons": [SEE_STEPS], "hints": []}}
    return {**document, "steps": steps}


SEE_STEPS = "the whole record of this protocol has no single k and b: see its steps"


OF_STEPS = ("time", "paired_position", "paired_force", "phase")
"""Columns from which the steps of a protocol are evaluated."""


def truth(settings: TrialSettings, depth: float) -> dict[str, Any]:
    """Return the true values of a trial on the simulated rig, with which estimates are compared.

    The stiffness is that of the palpated body in series with the transmission, because the encoder
    measures the position of the motor, before the transmission. `k_deepest` is the static force at
    `depth`, divided by `depth`. If the body has other values for fast motion or after a change, the
    key `further_laws` contains these values by name.
    """
    setup = settings.setup
    further = {name: known(setup, law, depth) for name, law in setup.cube.further_laws.items()}
    return {
        **known(setup, setup.cube.slow, depth),
        "force_lag_s": setup.force_lag,
        "lost_motion_m": setup.transmission.lost_motion,
        **({"further_laws": further} if further else {}),
    }


def known(setup: Setup, law: Law, depth: float) -> dict[str, float]:
    """Return the true damping and stiffness of a simulated body in series with the transmission."""
    return {
        "b": law.b,
        "k_surface": law.k1 / (1.0 + setup.transmission.compliance * law.k1),
        "k_deepest": setup.static_force(law, depth) / depth if depth else law.k1,
    }


def recorded_truth(recording: Recording) -> dict[str, Any] | None:
    """Return `truth` for a recorded trial on the simulated rig; None for every other recording."""
    settings = trial_settings(recording)
    if not settings or not settings.is_simulated:
        return None
    return truth(settings, float(np.max(np.abs(recording["slave_position"]), initial=0.0)))


def true_result(recording: Recording, position: float | None) -> dict[str, float] | None:
    """Return the true k and b of a trial on the simulated rig, at the position of its result.

    `k` and `b` are those of specimen and transmission in series, `k_tip` and `b_tip` those of the
    specimen.
    The result is None for any other recording, and for a body whose stiffness is not a function of
    the position.
    """
    settings = trial_settings(recording)
    if not settings or not settings.is_simulated or position is None:
        return None
    setup = settings.setup
    if setup.cube.further_laws:
        return None
    law, compliance = setup.cube.slow, setup.transmission.compliance
    k_tip = law.stiffness(law.compressed(position, compliance))
    series = 1.0 + compliance * k_tip
    return {"k": k_tip / series, "k_tip": k_tip, "b": law.b / series, "b_tip": law.b}
