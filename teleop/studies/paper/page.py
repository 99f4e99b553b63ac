"""Create the HTML page with the results of the reproduction of the paper, as one file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from estimation.quantities import DAMPING, FORCE_ERROR
from sim_backend import CUBES
from teleop.output.estimate_tables import RMS_RATIO
from teleop.output.web_page import web_page
from teleop.studies.anova import Effect, effect_cells
from teleop.studies.paper.claims import Claim
from teleop.studies.paper.methods import MethodResult
from teleop.studies.paper.study import RESPONSES, finding
from teleop.studies.paper.table1 import CONDITIONS, ESTIMATORS, TABLE_1, is_calibrated, table1
from teleop.studies.paper.trials import PaperTrial, SlowTrial

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
    """Return the cells of the table of further estimators, see `METHOD_HEADINGS`."""

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


def table_one(outcomes: Sequence[PaperTrial]) -> Iterator[tuple[str, list[dict[str, object]]]]:
    """Yield name and cells (simulated, paper, calibrated) of each row of Table I."""
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


def damping_cells(outcomes: Sequence[PaperTrial]) -> list[list[str]]:
    """Return b of each trial: paper, RLS, without one, two and all biases, true value."""
    return [
        [
            f"{outcome.condition} {outcome.cube}",
            DAMPING.number(outcome.damping.paper),
            DAMPING.number(outcome.damping.rls),
            DAMPING.number(outcome.damping.matched),
            DAMPING.number(outcome.damping.tip),
            f"{DAMPING.shown(outcome.damping.stiffening):.2f}",
            f"{DAMPING.shown(outcome.damping.true):g}",
        ]
        for outcome in outcomes
    ]


def slow_cells(slow: Sequence[SlowTrial]) -> list[list[str]]:
    """Return frequency [Hz], lag [ms] and b [N s/m] of each slow trial, with 95 % intervals."""
    return [
        [
            f"{trial.frequency:g}",
            f"{trial.lag.value * 1e3:.2f}",
            f"{trial.lag.low * 1e3:.2f} to {trial.lag.high * 1e3:.2f}",
            DAMPING.number(trial.b.value),
            f"{DAMPING.number(trial.b.low)} to {DAMPING.number(trial.b.high)}",
        ]
        for trial in slow
    ]


def reproduction_page(
    outcomes: Sequence[PaperTrial],
    claims: Sequence[Claim],
    figures: Mapping[str, Markup],
    slow: Sequence[SlowTrial],
    study: Mapping[str, Sequence[Effect]],
    seeds: int,
    methods: Mapping[str, MethodResult],
) -> str:
    """Return the page with all results of the reproduction as HTML."""
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
        b_heading=DAMPING.heading,
        true_b=DAMPING.text(slow[0].true_b, "g"),
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
