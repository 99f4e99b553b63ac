"""Create the HTML page with the results of the reproduction of the paper, as one file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from estimation.quantities import FORCE_ERROR
from sim_backend import CUBES
from teleop.output.effects_table import effect_cells
from teleop.output.estimate_tables import RMS_RATIO
from teleop.output.web_page import web_page
from teleop.studies.anova import Effect
from teleop.studies.paper.claims import Claim
from teleop.studies.paper.methods import MethodResult
from teleop.studies.paper.study import RESPONSES, finding
from teleop.studies.paper.table1 import CONDITIONS, ESTIMATORS, TABLE_1, is_calibrated, table1
from teleop.studies.paper.trials import Outcome, SlowTrial

TITLE = "Techniques for environment parameter estimation during telemanipulation, reproduced"
METHOD_HEADINGS = (
    "",
    "k error",
    "b error",
    "k within",
    "b within",
    "rise [s]",
    "e_f [N]",
    RMS_RATIO,
    "held",
)
"""Column headings of the table of further estimators. The first column contains the names of the
estimators."""


def method_cells(methods: Mapping[str, MethodResult]) -> list[list[str]]:
    """Return the cells of the table of further estimators as texts, one row for each estimator.

    Further estimators are those that a user requested in addition to the three of the paper. The
    headings of the columns are `METHOD_HEADINGS`.

    Parameters
    ----------
    methods
        Results of the further estimators, by the name of the estimator.
    """

    def percent(value: float, digits: int = 0) -> str:
        return f"{value:.{digits}%}" if math.isfinite(value) else "-"

    return [
        [
            name,
            percent(row.k_error, 1),
            f"{row.b_error:.1f}",
            percent(row.k_coverage),
            percent(row.b_coverage),
            f"{row.rise_time_s:.3f}" if math.isfinite(row.rise_time_s) else "-",
            f"{row.e_f:.3f}",
            f"{row.one_step_ratio:.2f}",
            percent(row.held),
        ]
        for name, row in methods.items()
    ]


def table_one(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, list[dict[str, object]]]]:
    """Yield each row of Table I: its name, and cells with the simulated and the paper's values.

    A row contains the results of one estimator under one control condition. A cell is a dictionary.
    Its entry `ours` is the simulated value, and its entry `paper` is the value in the paper. Its
    entry `calibrated` states whether this value of the paper was used to calibrate the simulated
    rig.

    Parameters
    ----------
    outcomes
        Results of the nine trials of one seed.
    """
    by_trial = {(outcome.condition, outcome.cube): outcome for outcome in outcomes}
    for condition in CONDITIONS:
        for estimator in ESTIMATORS:
            cells: list[dict[str, object]] = []
            for cube in CUBES:
                ours = by_trial[condition, cube].estimates[estimator]
                paper = table1()[condition, cube, estimator]
                calibrated = is_calibrated(condition, estimator)
                cells += [
                    {
                        "ours": one.number(ours[one.symbol]),
                        "paper": one.number(getattr(paper, one.symbol)),
                        "calibrated": calibrated and one is not FORCE_ERROR,
                    }
                    for one in TABLE_1
                ]
            yield f"{condition} {estimator.upper()}", cells


def damping_cells(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """Return the cells of the table of the damping as texts, with one row for each trial.

    A row contains the name of the trial, the damping in the paper, and the damping that recursive
    least squares (RLS) estimates in the simulated trial. These two values are biased. The next
    three values are estimates from which one, two and all three causes of bias are removed (see
    `Damping`). The last value is the true damping.
    """
    return [
        [
            f"{outcome.condition} {outcome.cube}",
            f"{outcome.damping.paper:.1f}",
            f"{outcome.damping.rls:.1f}",
            f"{outcome.damping.matched:.1f}",
            f"{outcome.damping.tip:.1f}",
            f"{outcome.damping.stiffening:.2f}",
            f"{outcome.damping.true:g}",
        ]
        for outcome in outcomes
    ]


def slow_cells(slow: Sequence[SlowTrial]) -> list[list[str]]:
    """Return the cells of the table of the slow trials as texts, with one row for each trial.

    In a slow trial, the slave moves sinusoidally with a low frequency. The lag of the force channel
    and the damping of the cube were both estimated from each trial. A row contains the frequency
    [Hz], the lag and its 95 % interval [ms], and the damping and its 95 % interval [N s/m].
    """
    return [
        [
            f"{trial.frequency:g}",
            f"{trial.lag.value * 1e3:.2f}",
            f"{trial.lag.low * 1e3:.2f} to {trial.lag.high * 1e3:.2f}",
            f"{trial.b.value:.1f}",
            f"{trial.b.low:.1f} to {trial.b.high:.1f}",
        ]
        for trial in slow
    ]


def reproduction_page(
    outcomes: Sequence[Outcome],
    claims: Sequence[Claim],
    figures: Mapping[str, Markup],
    slow: Sequence[SlowTrial],
    study: Mapping[str, Sequence[Effect]],
    seeds: int,
    methods: Mapping[str, MethodResult],
) -> str:
    """Return the page with all results of the reproduction as HTML.

    Parameters
    ----------
    outcomes
        Results of the nine trials of one seed.
    claims
        Claims of the paper, and whether they are true for the simulated trials.
    figures
        Figures as SVG elements, by caption.
    slow
        Estimated lag of the force channel and estimated damping, for each frequency of the motion.
    study
        Effects from an analysis of variance, by the name of the response (dependent variable);
        empty if there is only one seed.
    seeds
        Number of repetitions of the nine trials, each with another seed.
    methods
        Results of estimators that were requested in addition to the three of the paper, averaged
        over the trials; empty if none were requested.
    """
    return web_page(
        "reproduction.html",
        __package__,
        title=TITLE,
        cubes=list(CUBES),
        headings=[one.heading for one in TABLE_1],
        table_one=table_one(outcomes),
        claims=claims,
        figures=figures,
        damping=damping_cells(outcomes),
        true_b=f"{slow[0].true_b:g}",
        true_lag_ms=f"{slow[0].true_lag * 1e3:g}",
        slow=slow_cells(slow),
        method_headings=METHOD_HEADINGS,
        methods=method_cells(methods),
        study=[
            (RESPONSES[name], finding(effects), effect_cells(map(Effect._asdict, effects)))
            for name, effects in study.items()
        ],
        seeds=seeds,
    )
