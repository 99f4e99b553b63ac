"""Create the HTML page with the results of the reproduction of the paper, as one file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from sim_backend import CUBES
from teleop.control.conditions import CONDITIONS
from teleop.output.effects_table import effect_cells
from teleop.output.estimate_tables import RMS_RATIO
from teleop.output.web_page import web_page
from teleop.studies.anova import Effect
from teleop.studies.paper.claims import Claim
from teleop.studies.paper.methods import MethodResult
from teleop.studies.paper.study import RESPONSES, finding
from teleop.studies.paper.table1 import ESTIMATORS, is_calibrated, table1
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


def method_cells(methods: Mapping[str, MethodResult]) -> list[list[str]]:
    """Return the cells of the table of further estimators, with the columns `METHOD_HEADINGS`."""

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
    """Yield each row of Table I: its name, and cells with the simulated and the paper's values."""
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
                        "ours": f"{ours[name]:.{digits}f}",
                        "paper": f"{getattr(paper, name):.{digits}f}",
                        "calibrated": calibrated and name != "e_f",
                    }
                    for name, digits in (("b", 1), ("k", 0), ("e_f", 2))
                ]
            yield f"{condition} {estimator.upper()}", cells


def damping_cells(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """Return the cells of the table of the damping, with one row for each trial.

    A row contains the damping in the paper, the damping from RLS with all causes of bias, the
    estimates after each cause of bias is removed, and the true damping.
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
    """Return the cells of the table of lag and damping, with one row for each frequency.

    In each row, lag and damping were estimated together from one trial.
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
        Claims of the paper, and whether they are true.
    figures
        Figures as SVG elements, by caption.
    slow
        Estimates of lag and damping, one pair for each frequency of the excitation.
    study
        Effects of the analysis of variance, by response; empty if there is only one seed.
    seeds
        Number of repetitions of the nine trials.
    methods
        Results of further estimators, averaged over the trials; empty if none were requested.
    """
    return web_page(
        "reproduction.html",
        __package__,
        title=TITLE,
        cubes=list(CUBES),
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
