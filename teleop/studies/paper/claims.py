"""Check whether the claims (statements) of the paper are also true for the simulated trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from estimation.quantities import STIFFNESS
from sim_backend import CUBES
from teleop.studies.paper.table1 import CONDITIONS, ESTIMATORS
from teleop.studies.paper.trials import Damping, Outcome, as_rows

RISE = 0.6
"""Longest rise time that the paper states [s]."""
FACTOR = 2.0
"""A simulated damping or force error agrees with the paper if it is between 1 / `FACTOR` times and
`FACTOR` times the value in the paper."""
NEAR_DAMPING, NEAR_ERROR = 16, 22
"""Smallest number of the 27 cells of Table I that must agree with the paper in the damping, and
smallest number that must agree in the force error."""


class Claim(NamedTuple):
    """A claim, and whether it is true for the simulated trials.

    A claim is a statement of the paper about its results, or a statement that the simulated results
    agree with the paper or with the true values.
    """

    claim: str
    """The claim as a text."""
    holds: bool
    """Whether the claim is true."""
    evidence: str
    """Numbers that show whether the claim is true."""


def check_claims(outcomes: Sequence[Outcome]) -> list[Claim]:
    """Check all claims about the simulated results, and return whether each of them is true.

    Parameters
    ----------
    outcomes
        Simulated results of the paper's nine trials, for one seed.
    """
    rows = as_rows(outcomes)
    cell = {(row["condition"], row["cube"], row["estimator"]): row for row in rows}
    return [
        *table_claims(rows),
        *error_claims(cell),
        rise_claim(rows),
        *stiffness_claims(cell),
        *damping_claims([outcome.damping for outcome in outcomes], outcomes),
    ]


def table_claims(rows: list[dict[str, Any]]) -> list[Claim]:
    """Check that the simulated stiffness, damping and force error agree with the paper's Table I.

    Parameters
    ----------
    rows
        One row for each trial and estimator, from `as_rows`.
    """
    off = {
        f"{row['condition']} {row['cube']} {row['estimator']}": row["k"] / row["paper"]["k"] - 1.0
        for row in rows
    }
    within = sum(abs(share) <= 0.1 for share in off.values())
    worst = max(off, key=lambda name: abs(off[name]))
    b, e_f = (
        sum(1.0 / FACTOR <= row[name] / row["paper"][name] <= FACTOR for row in rows)
        for name in ("b", "e_f")
    )
    signs = sum((row["b"] < 0.0) == (row["paper"]["b"] < 0.0) for row in rows)
    cells = f"{len(rows)} cells of"
    return [
        Claim(
            "all stiffness cells lie within 10 % of the paper's",
            within == len(rows),
            f"{within} of {cells} k; furthest {worst}, {off[worst]:+.1%}",
        ),
        Claim(
            f"at least {NEAR_DAMPING} of 27 damping cells lie within a factor of {FACTOR:g}",
            b >= NEAR_DAMPING,
            f"{b} of {cells} b; {signs} have the paper's sign",
        ),
        Claim(
            f"at least {NEAR_ERROR} of 27 force errors lie within a factor of {FACTOR:g}",
            e_f >= NEAR_ERROR,
            f"{e_f} of {cells} e_f",
        ),
    ]


def error_claims(cell: dict[tuple[str, str, str], dict[str, Any]]) -> list[Claim]:
    """Check which estimator has the largest force error, and which one has the smallest.

    The first claim is that adaptive identification has the largest force error in every trial. The
    second claim is that recursive least squares (RLS) has the smallest force error in most trials.

    Parameters
    ----------
    cell
        The rows from `as_rows`, by (condition, cube, estimator).
    """
    claims = []
    for wording, name, pick, least in (
        ("adaptive identification has the largest force error in every trial", "ai", max, 9),
        ("RLS has the smallest force error in most trials (at least 7)", "rls", min, 7),
    ):
        others = []
        for condition in CONDITIONS:
            for cube in CUBES:
                errors = {e: cell[condition, cube, e]["e_f"] for e in ESTIMATORS}
                winner = pick(errors, key=errors.__getitem__)
                if winner != name:
                    note = cell[condition, cube, winner]["note"]
                    others.append(
                        f"{condition} {cube}: {winner} {errors[winner]:.2f} N, "
                        f"{name} {errors[name]:.2f} N" + (f" ({note})" if note else "")
                    )
        evidence = f"{9 - len(others)} of 9" + "".join(f"; {other}" for other in others)
        claims.append(Claim(wording, 9 - len(others) >= least, evidence))
    return claims


def rise_claim(rows: list[dict[str, Any]]) -> Claim:
    """Check that no estimate of the stiffness has a longer rise time than the paper states.

    `RISE` is the longest rise time that the paper states. The claim is false if a rise time is NaN.

    Parameters
    ----------
    rows
        One row for each trial and estimator, from `as_rows`.
    """
    slowest = max(
        rows, key=lambda row: math.inf if math.isnan(row["rise_time_s"]) else row["rise_time_s"]
    )
    return Claim(
        f"every rise time is at most {RISE} s",
        slowest["rise_time_s"] <= RISE,
        f"slowest {slowest['condition']} {slowest['cube']} {slowest['estimator']}, "
        f"{slowest['rise_time_s']:.2f} s",
    )


def stiffness_claims(cell: dict[tuple[str, str, str], dict[str, Any]]) -> list[Claim]:
    """Check how the estimated stiffness depends on the cube and on the control condition.

    The first claim is that the stiffness increases from the soft to the medium to the hard cube,
    for every condition and estimator. The second claim is that the stiffness is smaller under the
    condition `autonomous` than under `free`, for every cube and estimator.

    Parameters
    ----------
    cell
        The rows from `as_rows`, by (condition, cube, estimator).
    """
    rises = all(
        cell[c, "soft", e]["k"] < cell[c, "medium", e]["k"] < cell[c, "hard", e]["k"]
        for c in CONDITIONS
        for e in ESTIMATORS
    )
    falls = [
        f"{cube}: {STIFFNESS.number(cell['free', cube, 'rls']['k'])} to "
        f"{STIFFNESS.text(cell['autonomous', cube, 'rls']['k'])}"
        for cube in CUBES
    ]
    held = all(
        cell["free", cube, e]["k"] > cell["autonomous", cube, e]["k"]
        for cube in CUBES
        for e in ESTIMATORS
    )
    return [
        Claim(
            "stiffness increases from soft to medium to hard",
            rises,
            "each condition and estimator",
        ),
        Claim("stiffness decreases from free to autonomous", held, "with RLS, " + "; ".join(falls)),
    ]


def damping_claims(steps: list[Damping], outcomes: Sequence[Outcome]) -> list[Claim]:
    """Check the sign of the damping that is estimated with bias, and the value without bias.

    The first claim is that the damping from recursive least squares (RLS), which is biased, is
    negative in the same trials as in the paper. The second claim is that the estimated damping is
    close to the true damping if all causes of bias are removed.

    Parameters
    ----------
    steps
        For each trial, the true damping, and the estimates with and without causes of bias.
    outcomes
        Results of the same trials, in the same order.
    """
    positive = [
        f"{outcome.condition} {outcome.cube}: {step.rls:+.1f}"
        for outcome, step in zip(outcomes, steps, strict=True)
        if (step.rls < 0.0) != (step.paper < 0.0)
    ]
    share = max(abs(step.stiffening / step.true - 1.0) for step in steps)
    return [
        Claim(
            "RLS damping is negative in the same trials as in the paper",
            not positive,
            "; ".join(positive) or f"{len(steps)} of {len(steps)}",
        ),
        Claim(
            "matched conditioning, the position of the tip, and the x^3 term recover the true "
            "damping within 10 %",
            share <= 0.1,
            f"largest error {share:.1%} of b, {len(steps)} trials",
        ),
    ]
