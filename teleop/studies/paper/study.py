"""Compute an analysis of variance of the paper's nine trials, repeated with several seeds."""

from __future__ import annotations

from collections.abc import Sequence

from teleop.studies.anova import ESTIMATOR, Effect, analysis_of_variance
from teleop.studies.paper.table1 import ESTIMATORS
from teleop.studies.paper.trials import PaperTrial

RESPONSES = {"e_f": "Average force error [N]", "rise_time_s": "Rise time [s]"}
"""Responses (dependent variables) of the analyses of variance, with their headings."""


def effects_on(outcomes: Sequence[PaperTrial], response: str) -> list[Effect]:
    """Return the analysis of variance of a response: the effects of cube, condition and estimator.

    The result contains each main effect and each interaction, with its p value and effect sizes.
    """
    rows = [
        {
            "trial": f"{o.cube} {o.condition} {o.seed}",
            "cube": o.cube,
            "condition": o.condition,
            ESTIMATOR: name,
            response: o.estimates[name][response],
        }
        for o in outcomes
        for name in ESTIMATORS
    ]
    return analysis_of_variance(rows, response, ("cube", "condition"), "trial")


def finding(effects: Sequence[Effect]) -> str:
    """Return a sentence that compares the result of an analysis of variance with the paper.

    The paper states that "only the choice of the estimation algorithm has an effect".
    """
    largest = max(effects, key=lambda effect: effect.eta_squared)
    significant = [effect.source for effect in effects if effect.p < 0.01]
    others = [source for source in significant if source != "estimator"]
    verdict = f"Most variance is due to {largest.source} ({largest.eta_squared:.0%})"
    if not significant:
        return f"{verdict}; unlike in the paper, no effect is significant (p < 0.01)."
    if not others:
        return f"{verdict}; only the estimator has an effect, as in the paper."
    return (
        f"{verdict}; unlike in the paper, there are other effects (p < 0.01): {', '.join(others)}."
    )
