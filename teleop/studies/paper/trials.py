"""Run the paper's nine trials with the paper's settings.

The estimated damping in these trials is biased. The module also estimates the damping without the
causes of this bias.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from estimation import Estimates
from estimation.compiled import Floats
from estimation.stiffening import Interval, MatchedSignals
from teleop.control.excitation_signals import Sine
from teleop.names import ConditionName, CubeName
from teleop.studies.paper.methods import MethodResult, Methods, compare_methods
from teleop.studies.paper.table1 import is_calibrated, table1
from teleop.trial.result import Trial
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

DURATION = 10.0
"""Duration of a trial [s]."""
BANDWIDTH = 50.0
"""Bandwidth of the filtered difference that gives the velocity [Hz]. The paper does not state this
bandwidth."""
NO_METHODS = Methods()
"""Value for a reproduction without further estimators."""
DRAWN = 10
"""Distance between two ticks that the figures show [ticks]."""


class Damping(NamedTuple):
    """True damping in one trial, and its estimates [N s/m].

    In the estimates from `rls` to `stiffening`, the causes of bias are removed one after the other.
    """

    true: float
    """True damping of the simulated cube."""
    paper: float
    """Average of the damping from RLS in Table I of the paper."""
    rls: float
    """Average of the damping from RLS in the simulated trial, with the paper's settings."""
    matched: float
    """Damping from a Kelvin-Voigt fit, with compensated lag and the same filter for force and
    position."""
    tip: float
    """As `matched`, but with the position of the tip instead of the encoder position."""
    stiffening: float
    """As `tip`, but with x^3 as an additional regressor."""


class Outcome(NamedTuple):
    """Results of one trial."""

    condition: str
    """Name of the control condition."""
    cube: str
    """Name of the cube."""
    seed: int
    """Seed of the trial."""
    estimates: dict[str, dict[str, Any]]
    """Summary of the estimates, by the name of the estimator."""
    damping: Damping
    """Damping, with the causes of bias removed one after the other."""
    t: Floats
    """Time of every tenth tick [s], shape (n,)."""
    x: Floats
    """Displacement at the ticks of `t` [m], shape (n,)."""
    v: Floats
    """Velocity at the ticks of `t` [m/s], shape (n,)."""
    series: dict[str, Estimates]
    """Estimates at the ticks of `t`, by the name of the estimator."""
    methods: dict[str, MethodResult]
    """Results of further estimators on the same trial; empty if none were requested."""


class SlowTrial(NamedTuple):
    """Estimates of two quantities from one trial: lag of the force channel, and damping."""

    frequency: float
    """Frequency of the excitation [Hz]."""
    lag: Interval
    """Estimated lag with its 95 % interval [s]."""
    b: Interval
    """Estimated damping with its 95 % interval [N s/m]."""
    true_lag: float
    """True lag [s]."""
    true_b: float
    """True damping [N s/m]."""


def paper_trial(condition: ConditionName, cube: CubeName, seed: int = 0) -> TrialSettings:
    """Return the settings of one of the nine trials.

    As in the paper, the force is not filtered, the velocity is a filtered difference of the encoder
    position, and the estimators have the paper's settings.
    """
    return TrialSettings(
        condition=condition,
        cube=cube,
        duration=DURATION,
        clock="virtual",
        seed=seed,
        conditioning="difference",
        bandwidth=BANDWIDTH,
    )


def damping_steps(trial: Trial, rls: float) -> Damping:
    """Return estimates of the damping from which the causes of bias are removed one by one.

    The first estimate is that of the paper's method.

    Parameters
    ----------
    trial
        The simulated trial.
    rls
        Average of the damping from RLS in this trial, which is the first estimate [N s/m].
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


def palpate(trial: tuple[ConditionName, CubeName, int], methods: Methods = NO_METHODS) -> Outcome:
    """Run one trial, and run further estimators on the data of this trial.

    Parameters
    ----------
    trial
        Condition, cube and seed.
    methods
        Further estimators.
    """
    condition, cube, seed = trial
    run = run_trial(paper_trial(condition, cube, seed))
    estimates = run.summary()["estimates"]
    thin = slice(None, None, DRAWN)
    return Outcome(
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
    """Estimate lag and damping together from an autonomous trial on the medium cube.

    The ramps at the start and the end of the trial are not used. The position of the tip is used
    instead of the encoder position, so that lost motion has no effect.

    Parameters
    ----------
    frequency
        Frequency of the excitation [Hz].
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


def as_rows(outcomes: Iterable[Outcome]) -> list[dict[str, Any]]:
    """Return one row for each trial and estimator, with the values in the paper's Table I."""
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
