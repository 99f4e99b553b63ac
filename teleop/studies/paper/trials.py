"""Run the paper's nine trials in simulation, with the paper's settings.

The paper is Yamamoto et al., BioRob 2008. Its nine trials are all combinations of three control
conditions and three cubes. With the paper's settings, the estimated damping is biased. The bias has
three causes: the lag of the force channel, the lost motion of the slave, and the stiffening of the
cube. This module also estimates the damping without these causes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from estimation import Estimates
from estimation.arrays import Floats
from estimation.stiffening import Interval, MatchedSignals
from teleop.control.excitation_signals import Sine
from teleop.names import ConditionName, CubeName
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.paper.methods import FurtherMethods, MethodResult, compare_methods
from teleop.studies.paper.table1 import is_calibrated, table1
from teleop.trial.result import Trial
from teleop.trial.run import run_trial

DURATION = 10.0
"""Duration of a trial [s]."""
BANDWIDTH = 50.0
"""Bandwidth of the filtered difference that gives the velocity [Hz]. The paper does not state this
bandwidth."""
NO_METHODS = FurtherMethods()
"""Value of a parameter `methods`: no estimator is run in addition to the three of the paper."""
DRAWN = 10
"""Number of ticks from one point of a figure to the next point."""


class Damping(NamedTuple):
    """True damping of the cube in one trial, and several estimates of it [N s/m].

    The estimates `paper` and `rls` are those of recursive least squares (RLS). They are biased by
    three causes: the lag of the force channel, the lost motion of the slave, and the stiffening of
    the cube. The first cause is removed in `matched`, the first two in `tip`, and all three in
    `stiffening`.
    """

    true: float
    """True damping of the simulated cube."""
    paper: float
    """Average of the damping from RLS in Table I of the paper."""
    rls: float
    """Average of the damping from RLS in the simulated trial, with the paper's settings."""
    matched: float
    """Damping from a fit of the Kelvin-Voigt model f = b v + k x. The lag of the force channel is
    compensated, and force and position are filtered by the same filter."""
    tip: float
    """As `matched`, but with the true position of the slave's tip instead of the position that its
    encoder measures."""
    stiffening: float
    """As `tip`, but with the additional term k3 x^3 in the model."""


class PaperTrial(NamedTuple):
    """Results of one simulated trial of the paper."""

    condition: str
    """Name of the control condition."""
    cube: str
    """Name of the cube."""
    seed: int
    """Seed of the trial."""
    estimates: dict[str, dict[str, Any]]
    """Results of each estimator, such as the averages of b and k, by the name of the estimator."""
    damping: Damping
    """True damping, estimates with bias, and estimates without causes of bias."""
    t: Floats
    """Time of the ticks that the figures show [s], shape (n,), see `DRAWN`."""
    x: Floats
    """Displacement at the ticks of `t` [m], shape (n,)."""
    v: Floats
    """Velocity at the ticks of `t` [m/s], shape (n,)."""
    series: dict[str, Estimates]
    """Estimates at the ticks of `t`, by the name of the estimator."""
    methods: dict[str, MethodResult]
    """Results of the estimators that were requested in addition to those of the paper, by their
    names; empty if none were requested."""


class SlowTrial(NamedTuple):
    """Lag of the force channel and damping of the cube, both estimated from one slow trial.

    The trial is called slow because the slave moves sinusoidally with a low frequency.
    """

    frequency: float
    """Frequency of the sinusoidal motion [Hz]."""
    lag: Interval
    """Estimated time constant of the lag, with its 95 % interval [s]."""
    b: Interval
    """Estimated damping with its 95 % interval [N s/m]."""
    true_lag: float
    """True time constant of the lag of the simulated force channel [s]."""
    true_b: float
    """True damping of the simulated cube [N s/m]."""


def paper_trial(condition: ConditionName, cube: CubeName, seed: int = 0) -> TrialSettings:
    """Return the settings of one of the paper's nine trials, for one condition and one cube.

    As in the paper, the force is not filtered, the velocity is a filtered difference of the encoder
    position without correction, and the estimators have the paper's settings.
    """
    return TrialSettings(
        condition=condition,
        cube=cube,
        duration=DURATION,
        clock="virtual",
        seed=seed,
        conditioning="difference",
        bandwidth=BANDWIDTH,
        force_lag=0.0,
        lost_motion=0.0,
    )


def damping_steps(trial: Trial, rls: float) -> Damping:
    """Return the true damping in a trial, and estimates with fewer and fewer causes of bias.

    The docstring of `Damping` explains the causes of bias and the estimates.
    """
    settings, columns = trial.settings, trial.columns
    force, dt = columns["contact_force"], columns["dt"]
    encoder = MatchedSignals(columns["slave_position"], force, dt)
    tip = MatchedSignals(settings.setup.tip(columns["slave_position"]), force, dt)
    lag = settings.setup.force_lag
    return Damping(
        true=settings.setup.cube.slow.b,
        paper=table1()[settings.condition, settings.cube, "rls"].b,
        rls=rls,
        matched=encoder.fit(lag, stiffening=False).b,
        tip=tip.fit(lag, stiffening=False).b,
        stiffening=tip.fit(lag).b,
    )


def palpate(
    trial: tuple[ConditionName, CubeName, int], methods: FurtherMethods = NO_METHODS
) -> PaperTrial:
    """Run one of the paper's trials, and run further estimators on the data of this trial."""
    condition, cube, seed = trial
    run = run_trial(paper_trial(condition, cube, seed))
    estimates = run.summary()["estimates"]
    thin = slice(None, None, DRAWN)
    return PaperTrial(
        condition,
        cube,
        seed,
        estimates,
        damping_steps(run, estimates["rls"]["b"]),
        run.columns["time"][thin],
        run.columns["x"][thin],
        run.columns["v"][thin],
        {name: e.part(thin) for name, e in run.estimates.items()},
        compare_methods(run, methods) if methods.estimators else {},
    )


def lag_and_damping(frequency: float) -> SlowTrial:
    """Estimate the lag of the force channel and the damping of the cube from one simulated trial.

    In this trial, the slave moves sinusoidally (condition `autonomous`) on the medium cube. The
    start and the end of the trial, where the displacement increases from zero and decreases to
    zero, are not used. The true position of the slave's tip is used instead of the position that
    its encoder measures. Therefore, lost motion between encoder and tip has no effect.
    """
    settings = replace(
        paper_trial("autonomous", "medium"),
        signal=Sine(frequency),
        duration=max(DURATION, 1.0 / frequency),
    )
    columns = run_trial(settings).columns
    setup = settings.setup
    signals = MatchedSignals(
        setup.tip(columns["slave_position"]),
        columns["contact_force"],
        columns["dt"],
        part=slice(1000, -1000),
    )
    coarse = setup.force_lag * np.linspace(0.6, 1.4, 17)
    around = signals.profile(coarse).lag_interval()
    step = coarse[1] - coarse[0]
    profile = signals.profile(np.linspace(around.low - step, around.high + step, 33))
    return SlowTrial(
        frequency,
        profile.lag_interval(),
        profile.b_interval(),
        setup.force_lag,
        setup.cube.slow.b,
    )


def as_rows(outcomes: Iterable[PaperTrial]) -> list[dict[str, Any]]:
    """Return the results as table rows, one row for each trial and each of the three estimators.

    Each row is a dictionary. Its entry `paper` contains the values that Table I of the paper states
    for the same trial and estimator. The other entries are the simulated results.
    """
    return [
        {
            "condition": outcome.condition,
            "cube": outcome.cube,
            "estimator": name,
            "b": summary["b"],
            "k": summary["k"],
            "e_f": summary["e_f"],
            "rise_time_s": summary["rise_time_s"],
            "note": summary["note"],
            "paper": table1()[outcome.condition, outcome.cube, name]._asdict(),
            "calibrated": is_calibrated(outcome.condition, name),
        }
        for outcome in outcomes
        for name, summary in outcome.estimates.items()
    ]
