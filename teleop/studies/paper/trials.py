"""The paper's nine trials, run with the paper's settings, and what became of their damping."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from estimation import Estimates
from estimation.compiled import Floats
from estimation.stiffening import Interval, MatchedSignals
from teleop.control.excitation_signals import Sine
from teleop.studies.paper.methods import MethodResult, Methods, compare_methods
from teleop.studies.paper.table1 import is_calibrated, table1
from teleop.trial.result import Trial
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

DURATION = 10.0
"""Length of a trial [s]."""
BANDWIDTH = 50.0
"""Bandwidth of the filtered difference that gives velocity [Hz]; the paper tells none."""
NO_METHODS = Methods()
DRAWN = 10
"""Every so many ticks are drawn in figures."""


class Damping(NamedTuple):
    """Damping of one trial [N s/m], its causes of error removed one by one."""

    true: float
    paper: float
    """The paper's own RLS, on the paper's rig."""
    rls: float
    """RLS as in the paper."""
    matched: float
    """Kelvin-Voigt, with force and position matched."""
    tip: float
    """Matched, with the position of the tip instead of the encoder's."""
    stiffening: float
    """That, and with x^3 among the regressors."""


class Outcome(NamedTuple):
    """One trial."""

    condition: str
    cube: str
    seed: int
    estimates: dict[str, dict[str, Any]]
    """Summary of each estimator."""
    damping: Damping
    t: Floats
    x: Floats
    v: Floats
    series: dict[str, Estimates]
    """Estimates over time, thinned out like t, x and v for drawing."""
    methods: dict[str, MethodResult]
    """What other methods made of the same trial; empty where none were asked for."""


class SlowTrial(NamedTuple):
    """What one trial tells of the force channel's lag and of damping, fitted together."""

    frequency: float
    """Of the excitation [Hz]."""
    lag: Interval
    """[s]"""
    b: Interval
    """[N s/m]"""
    true_lag: float
    """[s]"""
    true_b: float
    """[N s/m]"""


def paper_trial(condition: str, cube: str, seed: int = 0) -> TrialSettings:
    """One of the nine trials.

    Force is taken as it comes and velocity from the encoder by a filtered difference, as the
    paper has it; the estimators have the paper's settings.
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


def damping_steps(trial: Trial) -> Damping:
    """The damping that the paper's way gives, and what is left as its errors are removed."""
    settings, columns = trial.settings, trial.columns
    force, dt = columns["contact_force"], columns["dt"]
    encoder = MatchedSignals(columns["slave_position"], force, dt)
    tip = MatchedSignals(settings.setup.tip(columns["slave_position"]), force, dt)
    lag = settings.setup.force_lag
    return Damping(
        true=settings.setup.cube.b,
        paper=table1()[settings.condition, settings.cube, "rls"].b,
        rls=float(columns["rls_b"].mean()),
        matched=encoder.fit(lag, stiffening=False).b,
        tip=tip.fit(lag, stiffening=False).b,
        stiffening=tip.fit(lag).b,
    )


def palpate(trial: tuple[str, str, int], methods: Methods = NO_METHODS) -> Outcome:
    """Run one trial (condition, cube, seed), and further methods over it."""
    condition, cube, seed = trial
    run = run_trial(paper_trial(condition, cube, seed))
    thin = slice(None, None, DRAWN)
    return Outcome(
        condition,
        cube,
        seed,
        run.summary()["estimates"],
        damping_steps(run),
        run.columns["time"][thin],
        run.columns["x"][thin],
        run.columns["v"][thin],
        {name: e.part(thin) for name, e in run.estimates.items()},
        compare_methods(run, methods) if methods.estimators else {},
    )


def lag_and_damping(frequency: float) -> SlowTrial:
    """Fit lag and damping together to an autonomous trial on the medium cube, ramps left out.

    The position is that of the tip, so that there is no lost motion.
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
        setup.cube.b,
    )


def as_rows(outcomes: Iterable[Outcome]) -> list[dict[str, Any]]:
    """A row for each trial and estimator, with the paper's cell beside ours."""
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
