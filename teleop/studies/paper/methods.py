"""Run further estimators on the paper's nine trials, and compute the errors of the estimates.

Further estimators are those that a user requests in addition to the three of the paper.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from estimation import MatchedFilter, Model, estimated_force, force_error, paper_preset, rise_time
from estimation.model import KELVIN_VOIGT
from teleop.evaluation.online.model_comparison import Comparison, compare
from teleop.trial.result import Trial


class MethodResult(NamedTuple):
    """Errors of one estimator in one trial, or averages of its errors over several trials."""

    k_error: float
    """Root mean square error of the stiffness, as a fraction of the true stiffness."""
    b_error: float
    """Root mean square error of the damping [N s/m]."""
    k_coverage: float
    """Fraction of the samples at which the 95 % interval of the stiffness contains the true
    value."""
    b_coverage: float
    """Fraction of the samples at which the 95 % interval of the damping contains the true value."""
    rise_time_s: float
    """Rise time of the estimated stiffness [s]."""
    e_f: float
    """Average force error [N]."""
    one_step_ratio: float
    """Root mean square error of the force that is predicted one sample ahead. It is divided by the
    same error of batch least squares with a sliding window, see `Comparison.one_step_ratio`."""
    held: float
    """Fraction of the samples at which the estimate was held constant."""


class FurtherMethods(NamedTuple):
    """Estimators that a user requests in addition to the three of the paper, and their model."""

    estimators: tuple[str, ...] = ()
    """Names of the estimators; empty if none are requested."""
    model: Model = KELVIN_VOIGT
    """Model of the environment for those of the estimators that support several models."""


def compare_methods(trial: Trial, methods: FurtherMethods) -> dict[str, MethodResult]:
    """Run estimators on the data of a simulated trial, and compute the errors of the estimates.

    All estimators use the paper's settings and process the same signals: the measured force, and
    the true position x of the slave's tip, so that lost motion has no effect. The lag of the force
    channel is compensated.

    The force of the cube is f = b v + k1 x + k3 x^3. The estimated damping is compared with b. The
    stiffness from an estimator without the parameter k3 is compared with k1 + k3 x^2, the secant
    stiffness of the cube at the x of each sample. The stiffness from an estimator that also
    estimates k3 is compared with k1, the stiffness at the surface of the cube.
    """
    settings, columns = trial.settings, trial.columns
    model = methods.model
    conditioner = MatchedFilter(force_lag=settings.setup.force_lag, model=model)
    tip = settings.setup.tip(columns["slave_position"])
    regression = conditioner.run(tip, columns["contact_force"], columns["dt"])
    preset = replace(
        paper_preset(settings.cube),
        estimators=methods.estimators,
        model=model,
        correlation=conditioner.correlation(1.0 / settings.loop_rate),
    )
    bank = preset.bank()
    estimates = bank.run(*regression)
    cube = settings.setup.cube.slow
    secant = cube.k1 + cube.k3 * regression.x**2
    compared: dict[str, Comparison] = {}
    for k, at_surface in ((secant, False), (np.full_like(secant, cube.k1), True)):
        group = {n: estimates[n] for n, e in bank.items() if ("k3" in e.names) is at_surface}
        compared |= compare(regression, bank, group, cube.b, k)
    return {
        name: MethodResult(
            k_error=compared[name].k_error,
            b_error=compared[name].b_error,
            k_coverage=compared[name].k_coverage,
            b_coverage=compared[name].b_coverage,
            rise_time_s=rise_time(columns["time"], series.k),
            e_f=force_error(regression.f, estimated_force(regression, series)),
            one_step_ratio=compared[name].one_step_ratio,
            held=float(np.mean(series.held)),
        )
        for name, series in estimates.items()
    }


def averages(results: Sequence[Mapping[str, MethodResult]]) -> dict[str, MethodResult]:
    """Average the results of each estimator over several trials.

    The average of `k_error` is the root mean square. All other averages are arithmetic means.
    """
    found = {}
    for name in results[0]:
        rows = np.array([result[name] for result in results])
        means = dict(zip(MethodResult._fields, np.mean(rows, axis=0).tolist(), strict=True))
        means["k_error"] = float(np.sqrt(np.mean(rows[:, 0] ** 2)))
        found[name] = MethodResult(**means)
    return found
