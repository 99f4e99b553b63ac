"""Several recordings of one specimen taken together: whether one body explains them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from estimation import PooledSegments, least_squares
from estimation.estimator import LEVEL_95
from teleop.evaluation.evaluation import Evaluation


def taken_together(evaluations: Mapping[str, Evaluation]) -> dict[str, Any]:
    """One fit to all recordings, and whether segments of them agree, as `--json` prints it.

    Parameters
    ----------
    evaluations
        At least two, by the name of their file.
    """
    length = max(e.preset.segment for e in evaluations.values())
    segments = PooledSegments(length)
    for evaluation in evaluations.values():
        segments.correlation = evaluation.preset.correlation
        x, v, f, dt, _ = evaluation.regression
        apart = dt.copy()
        apart[0] = 2.0 * length
        segments.run(x, v, f, apart)
    regressions = [e.regression for e in evaluations.values()]
    x, v, f = (np.concatenate([r[channel] for r in regressions]) for channel in range(3))
    fit = least_squares(x, v, f)
    fits = [least_squares(*regression[:3]) for regression in regressions]
    alone = np.concatenate([one.residual for one in fits])
    last = segments.estimate
    return {
        "alone": [
            {"file": file, "b": one.b, "k": one.k, "rms": one.rms}
            for file, one in zip(evaluations, fits, strict=True)
        ],
        "b": fit.b,
        "k": fit.k,
        "rms": fit.rms,
        "rms_alone": float(np.sqrt(np.mean(alone**2))),
        "segments": segments.segments,
        "b_interval": LEVEL_95 * last.b_std,
        "k_interval": LEVEL_95 * last.k_std,
        "misfit": segments.misfit,
        "note": segments.note(segments.run([], [], [], [])),
    }
