r"""Test the effects of factors on the results of recordings, with a linear mixed model.

The model of the result y_i of recording i, such as its stiffness, is

    y_i = x_i' beta + u_r(i) + sum_W u_rW(i) + d_i + e_i.

x_i contains the fixed factors and all their interactions. u_r is the effect of the level r of the
random factor, for example of the specimen. u_rW is its interaction with the fixed factors W that
vary within a level of the random factor. d_i is the difference between repeated recordings, and e_i
is the error of the result. The variance of e_i is known from the 95 % interval of the result. The
other variances are estimated by restricted maximum likelihood (REML). A recording is thus weighted
by 1 / (variance of e_i + variance of d_i), as in meta-regression with random effects, and a result
with a narrow interval does not dominate if the recordings differ by more than their intervals.

An effect is tested by Wald's F test. The degrees of freedom of the error are those of the
interaction of the random factor with the factors of the effect, beyond all fixed effects. With
complete, balanced data, intervals of width zero and no variance that is estimated as zero, the test
is the one of the analysis of variance of repeated measures or of nested designs. If the weighted
residuals are larger than the estimated variances explain, the F statistic is divided by their mean
square (Knapp and Hartung). If the recordings scatter less than their intervals state, the intervals
determine the error.

`MixedLM` of statsmodels and comparable programs do not support known variances of e_i.

References
----------
G. Knapp and J. Hartung, "Improved tests for a random effects meta-regression with a single
covariate", Statistics in Medicine 22(17), 2003.
W. Viechtbauer, "Bias and efficiency of meta-analytic variance estimators in the random-effects
model", Journal of Educational and Behavioral Statistics 30(3), 2005.
J. C. Pinheiro and D. M. Bates, "Mixed-Effects Models in S and S-PLUS", 2000, chapter 2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky
from scipy.optimize import minimize
from scipy.special import fdtrc

from estimation.arrays import Floats
from teleop.errors import InputError

Levels = Sequence[Sequence[str]]
"""Level of each recording, for each factor."""
STARTS = (0.01, 0.3)
"""Variances from which the search for the maximum of the likelihood starts, relative to the
variance of the response."""
WHAT = "analysis of variance"


class FixedEffect(NamedTuple):
    """Test of one effect."""

    source: str
    """Name of the factor; for an interaction, names of its factors."""
    degrees: int
    """Degrees of freedom of the effect."""
    error_degrees: int
    """Degrees of freedom of the error."""
    f: float
    """F statistic."""
    p: float
    """p value of the F test."""
    partial_eta_squared: float
    """F times `degrees`, divided by the sum of this product and `error_degrees`."""


@dataclass(frozen=True)
class MixedModel:
    """Fit of the model to the results of recordings."""

    effects: list[FixedEffect]
    """The effects of the fixed factors and of their interactions."""
    components: dict[str, float]
    """Standard deviations of the random effects, by what they vary between, in the unit of the
    response. The last one is the difference between repeated recordings, d_i."""
    error: float
    """Root mean square of the standard deviations of e_i, from the intervals of the results."""
    recordings: int
    """Number of recordings."""


def fit_mixed_model(
    y: Floats,
    std: Floats,
    factors: Sequence[str],
    levels: Levels,
    random: str | None = None,
    groups: Sequence[str] = (),
) -> MixedModel:
    """Fit the model by restricted maximum likelihood, and test the effects of the fixed factors.

    Parameters
    ----------
    y, std
        Results, for example stiffnesses [N/m], and the standard deviations of their errors e_i,
        shape (n,). The half width of a 95 % interval is 1.96 standard deviations.
    factors, levels
        Names of the fixed factors, and for each of them the levels of the recordings.
    random, groups
        Name of the random factor and the levels of the recordings; None without such a factor.

    Returns
    -------
    MixedModel
        Tests of the effects, and the estimated standard deviations in the unit of the results.

    Raises
    ------
    InputError
        A combination of levels has no recording, or there are too few recordings for the error.
    """
    kept = [i for i, column in enumerate(levels) if len(set(column)) > 1]
    if not kept:
        raise InputError(f"{WHAT}: expected a factor with two levels or more")
    codes = [coded(levels[i]) for i in kept]
    names = [factors[i] for i in kept]
    design, terms = fixed_design(names, codes)
    scale = float(np.std(y))
    if not scale > 0.0:
        raise InputError(f"{WHAT}: the response is the same in all recordings")
    grouping = coded(groups) if random else np.zeros(len(y), int)
    within = [i for i, code in enumerate(codes) if random and varies(code, grouping)]
    shared = {w: cells([grouping, *(codes[i] for i in w)]) for w in subsets(within)}
    if not random:
        shared = {}
    degrees = {
        term: error_degrees(design, [shared[w] for w in subsets(inside)] if random else [], names)
        for term in terms
        for inside in [[i for i in term if i in within]]
    }
    # one recording for each cell: its random effect is the difference between recordings
    shared = {w: code for w, code in shared.items() if len(np.unique(code)) < len(y)}
    model = Likelihood(y / scale, std / scale, design, [*shared.values()], grouping)
    variances = model.maximised()
    solution = model.solved(variances)
    beta, covariance = solution.beta, solution.covariance * max(1.0, solution.residual)
    effects = []
    for term, columns in terms.items():
        q, df = columns.stop - columns.start, degrees[term]
        wald = float(beta[columns] @ np.linalg.solve(covariance[columns, columns], beta[columns]))
        f = wald / q
        source = " x ".join(names[i] for i in term)
        effects.append(FixedEffect(source, q, df, f, float(fdtrc(q, df, f)), wald / (wald + df)))
    between = [" x ".join([str(random), *(names[i] for i in w)]) for w in shared]
    deviations = [scale * math.sqrt(variance) for variance in variances]
    components = dict(zip([*between, "recording"], deviations, strict=True))
    return MixedModel(effects, components, float(np.sqrt(np.mean(std**2))), len(y))


def coded(levels: Sequence[str]) -> NDArray[np.int_]:
    """Return the number of the level of each recording, in the order of their occurrence."""
    numbers = {level: number for number, level in enumerate(dict.fromkeys(levels))}
    return np.array([numbers[level] for level in levels])


def cells(codes: Sequence[NDArray[np.int_]]) -> NDArray[np.int_]:
    """Return the number of the combination of levels of each recording."""
    _, numbers = np.unique(np.column_stack(codes), axis=0, return_inverse=True)
    return np.asarray(numbers).ravel()


def varies(code: NDArray[np.int_], groups: NDArray[np.int_]) -> bool:
    """Return whether a factor has several levels within a level of another factor."""
    return len(np.unique(cells([groups, code]))) > len(np.unique(groups))


def subsets(items: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield all subsets of some factors, from the empty subset to all factors."""
    return chain.from_iterable(combinations(items, size) for size in range(len(items) + 1))


def indicators(code: NDArray[np.int_]) -> Floats:
    """Return a matrix with a column for each level, which is 1 in the rows of this level."""
    return np.asarray(np.unique(code)[None, :] == code[:, None], np.float64)


def fixed_design(
    names: Sequence[str], codes: Sequence[NDArray[np.int_]]
) -> tuple[Floats, dict[tuple[int, ...], slice]]:
    """Return the matrix of the fixed effects, and the columns of each effect.

    The levels are coded as deviations from the mean (sum contrasts), so that the test of a factor
    concerns its mean effect over the levels of the other factors.
    """
    counts = [int(code.max()) + 1 for code in codes]
    missing = math.prod(counts) - len(np.unique(cells(codes)))
    if missing:
        raise InputError(
            f"{WHAT}: {missing} combinations of the levels of {', '.join(names)} have no recording:"
            " expected fewer factors (--by), or a nested factor as the random factor (--random)"
        )
    main = [
        np.vstack([np.eye(count - 1), -np.ones(count - 1)])[code]
        for count, code in zip(counts, codes, strict=True)
    ]
    blocks = [np.ones((len(codes[0]), 1))]
    terms: dict[tuple[int, ...], slice] = {}
    width = 1
    for term in subsets(range(len(codes))):
        if not term:
            continue
        block = main[term[0]]
        for i in term[1:]:
            block = (block[:, :, None] * main[i][:, None, :]).reshape(len(block), -1)
        blocks.append(block)
        terms[term] = slice(width, width + block.shape[1])
        width += block.shape[1]
    return np.hstack(blocks), terms


def error_degrees(design: Floats, strata: Sequence[NDArray[np.int_]], names: Sequence[str]) -> int:
    """Return the degrees of freedom of the error of an effect.

    `strata` are the cells of the random factor, of its interactions with some factors of the
    effect, and at last with all factors of the effect; empty without a random factor.
    """
    if not strata:
        found = len(design) - rank(design)
    else:
        lower = [design, *(indicators(code) for code in strata[:-1])]
        found = rank(np.hstack([*lower, indicators(strata[-1])])) - rank(np.hstack(lower))
    if found < 1:
        raise InputError(
            f"{WHAT}: too few recordings to test {', '.join(names)}: expected repeated recordings, "
            "or more levels of the random factor"
        )
    return found


def rank(matrix: Floats) -> int:
    """Return the rank of a matrix."""
    return int(np.linalg.matrix_rank(matrix))


class Solution(NamedTuple):
    """The restricted likelihood and the fixed effects for certain variances."""

    cost: float
    """-2 log of the likelihood, without a constant."""
    slope: Floats
    """Derivatives of `cost` with respect to the variances."""
    beta: Floats
    """The fixed effects, shape (p,)."""
    covariance: Floats
    """Covariance matrix of the fixed effects, shape (p, p)."""
    residual: float
    """Mean square of the weighted residuals; 1 on average for the true variances."""


class Likelihood:
    """The restricted likelihood of the model, as a function of the unknown variances.

    Parameters
    ----------
    y, std
        Results and the standard deviations of e_i, shape (n,), in units of the spread of y.
    design
        Matrix of the fixed effects, shape (n, p).
    shared
        For each random effect, the number of its level for each recording.
    groups
        Number of the level of the random factor. Recordings with different numbers are independent.
    """

    def __init__(
        self,
        y: Floats,
        std: Floats,
        design: Floats,
        shared: Sequence[NDArray[np.int_]],
        groups: NDArray[np.int_],
    ) -> None:
        self._known, self._x, self._y = std**2, design, y
        self._size = len(shared) + 1
        # without random effects, all recordings are independent
        members = [np.flatnonzero(groups == group) for group in np.unique(groups)] if shared else []
        self._blocks = [
            (rows, [np.equal.outer(code[rows], code[rows]).astype(float) for code in shared])
            for rows in members
        ]

    def solved(self, variances: Floats) -> Solution:
        """Return the likelihood and the fixed effects.

        The last of the variances is that of the differences between recordings.
        """
        diagonal = self._known + variances[-1]
        x, y = self._x, self._y
        weighted = x / diagonal[:, None]
        inverses = []
        determinant = float(np.sum(np.log(diagonal)))
        if self._blocks:
            determinant, weighted = 0.0, np.empty_like(x)
        for rows, same in self._blocks:
            v = np.diag(diagonal[rows]) + np.tensordot(variances[:-1], same, 1)
            lower = cholesky(v, lower=True)
            determinant += 2.0 * float(np.sum(np.log(np.diag(lower))))
            inverse = cho_solve((lower, True), np.eye(len(rows)))
            weighted[rows] = inverse @ x[rows]
            inverses.append(inverse)
        information = x.T @ weighted
        covariance = np.linalg.inv(information)
        beta = covariance @ (weighted.T @ y)
        residual = y - x @ beta
        forces = residual / diagonal
        slope = np.zeros(self._size)
        if not self._blocks:
            leverage = np.sum((weighted @ covariance) * weighted, axis=1)
            slope[0] = float(np.sum(1.0 / diagonal - leverage - forces**2))
        for (rows, same), inverse in zip(self._blocks, inverses, strict=True):
            forces[rows] = inverse @ residual[rows]
            projection = inverse - weighted[rows] @ covariance @ weighted[rows].T
            for i, one in enumerate([*same, np.eye(len(rows))]):
                slope[i] += float(np.sum(projection * one) - forces[rows] @ one @ forces[rows])
        square = float(residual @ forces)
        cost = determinant + float(np.linalg.slogdet(information)[1]) + square
        return Solution(cost, slope, beta, covariance, square / (len(y) - x.shape[1]))

    def maximised(self) -> Floats:
        """Return the variances with the largest likelihood, the last of them between recordings."""
        # results without an error are not divided by a variance of zero
        least = 0.0 if self._known.min() > 0.0 else 1e-10
        found = [
            minimize(
                lambda variances: self.solved(variances)[:2],
                np.full(self._size, start),
                jac=True,
                method="L-BFGS-B",
                bounds=[*[(0.0, None)] * (self._size - 1), (least, None)],
                options={"ftol": 1e-15, "gtol": 1e-9, "maxiter": 1000},
            )
            for start in STARTS
        ]
        return np.asarray(min(found, key=lambda one: float(one.fun)).x)
