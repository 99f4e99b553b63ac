"""Compute k and b of a trial after its end, as `teleop estimate` does from its recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from estimation import Preset
from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.evaluation.batch.stiffness_result import without_result
from teleop.evaluation.evaluate import KEPT, evaluate
from teleop.evaluation.evaluation import Evaluation
from teleop.evaluation.reading.recorded import RecordedSamples, recorded_signals
from teleop.evaluation.reading.samples import Samples, is_replayed
from teleop.evaluation.reason import Reason
from teleop.evaluation.settings import settings_summary
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.trial.recorded_trial import estimate_settings, true_result, with_steps

FAILED = "the evaluation failed because of an error in the program"
"""Reason without k and b after an unexpected exception, which must not end a session."""
PARTS = ("result", "best_model", "models", "transmission", "steps")
"""Parts of the evaluation that are shown at the end of a trial: k and b, the fitted models, the
values for which k and b are corrected, and the steps of a protocol."""
DRAWN = 800
"""Approximate largest number of samples in the picture of force over depth."""
DIGITS = 5
"""Number of significant digits of a number in this picture."""


class TrialResult(NamedTuple):
    """Result of the evaluation of a trial."""

    summary: dict[str, Any]
    """The parts `PARTS` of the document that `teleop estimate --json` prints. If the evaluation is
    not possible, the result contains the reasons."""
    picture: dict[str, Any] | None
    """Force over depth, as the live page draws it (`force_over_depth`)."""
    true: dict[str, float] | None = None
    """True k and b on the simulated rig (`true_result`); None if they are not known."""


def trial_result(ticks: Recording | RecordingFile, recorded: Path | None) -> TrialResult:
    """Return the result of a trial from its recording, or from its ticks if there is none.

    The batch evaluation does not depend on the estimators. Therefore only one of them is run, which
    is much faster than all estimators of the trial.
    """
    try:
        evaluation, stated, recording = evaluated(ticks, recorded)
        document = {**stated, **evaluation.batch_summary()}
        document = with_steps(document, recording, recorded_path(ticks, recorded))
        return TrialResult(
            {name: document[name] for name in PARTS},
            force_over_depth(evaluation),
            true_result(recording, evaluation.analysis.result.position),
        )
    except InputError as problem:
        return without(str(problem))
    except Exception as error:  # a session continues after it
        return without(f"{FAILED}: {type(error).__name__}: {error}")


def without(reason: str) -> TrialResult:
    """Return a result without k and b."""
    result = without_result([Reason(reason)]).summary()
    return TrialResult(
        {"result": result, "best_model": None, "models": [], "transmission": None, "steps": []},
        None,
    )


def recorded_path(ticks: Recording | RecordingFile, recorded: Path | None) -> Path | None:
    """Return the file of a trial; None if it is in memory only."""
    return ticks.path if isinstance(ticks, RecordingFile) else recorded


def evaluated(
    ticks: Recording | RecordingFile, recorded: Path | None
) -> tuple[Evaluation, dict[str, Any], Recording]:
    """Evaluate a trial; return evaluation, settings that influenced it, and its recording."""
    path = recorded_path(ticks, recorded)
    if path:
        file = RecordedSamples(path, is_replayed)
        samples: Samples = file
        recording = file.recording
    else:
        assert isinstance(ticks, Recording)
        recording = ticks
        samples = Samples(recorded_signals(recording))
    settings = estimate_settings(recording)
    assert isinstance(settings.preset, Preset)
    names = settings.preset.estimators
    alone = replace(settings, estimators=names[:1])
    # as many samples are kept as with all estimators
    evaluation = evaluate(samples, alone, KEPT / len(names))
    return evaluation, settings_summary(settings), recording


def force_over_depth(evaluation: Evaluation) -> dict[str, Any]:
    """Return the measured and the fitted force over the depth, for a picture.

    `depth` [m] and `force` [N] have some of the samples, relative to the datum. `fit` [N] is the
    force of the best model at these samples; None without such a model. `tangent` has the point at
    which k is the slope, with the keys `depth`, `force` and `k`; None if k is not identifiable.
    """
    record, datum = evaluation.analysis.record, evaluation.datum
    every = max(1, len(record.t) // DRAWN)
    best, result = evaluation.best_model, evaluation.analysis.result
    fit = None
    if best is not None:
        # the models are fitted to the force without its baseline
        fitted = evaluation.analysis.data or record
        fit = rounded((best.predicted + record.f - fitted.f)[::every])
    return {
        "depth": rounded(record.x[::every] - datum.x),
        "force": rounded(record.f[::every] - datum.f),
        "fit": fit,
        "tangent": tangent(evaluation) if result.identifiable else None,
    }


def tangent(evaluation: Evaluation) -> dict[str, float] | None:
    """Return the point of the picture at which k is the slope of the force."""
    analysis, datum = evaluation.analysis, evaluation.datum
    result, record, phases = analysis.result, analysis.record, analysis.phases
    if result.force is None or result.depth is None:
        return None
    lowest = float(record.x[phases.usable].min())
    point = phases.contact_point if result.depth_from == "contact point" else None
    level = phases.free_force or 0.0
    return {
        "depth": (point.value if point else lowest) + result.depth - datum.x,
        "force": result.force + level - datum.f,
        "k": float(result.k or 0.0),
    }


def rounded(values: Floats) -> list[float]:
    """Return values with `DIGITS` significant digits."""
    return [float(f"{value:.{DIGITS}g}") for value in np.asarray(values)]
