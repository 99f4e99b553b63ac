"""Parameterisation redundancy: which candidates the motion cannot tell apart, Lemmas 1 and 2.

With theta = (b, k), phi = [v, x] and the plant theta_0, a candidate's force error is
(theta - theta_0)' phi and its monitoring signal (11) the quadratic form

    mu(theta) = (theta - theta_0)' S (theta - theta_0)
    S = int e^(-2 lambda (t - tau)) phi phi' dtau.

For two candidates gamma and epsilon, with difference d = gamma - epsilon and sum of errors
s = (gamma - theta_0) + (epsilon - theta_0),

    mu_gamma - mu_epsilon = d' S s = int e^(-2 lambda (t - tau)) (d' phi)(s' phi) dtau,

which is zero at all times if and only if (d' phi)(s' phi) is: where s = 0, the mirrored pair (15);
where d' phi = 0, the exponential (14); or where s' phi = 0, the exponential (16). Lemma 1 is the
case that epsilon is the plant, d = s, where (14) is (12). The paper's further condition to (16),
that the two errors be parallel, is not needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from estimation.methods.multi_estimator import MultiEstimator


class Candidate(NamedTuple):
    """Damping `b` [N s/m] and stiffness `k` [N/m] of an estimator of the bank, or of the plant."""

    b: float
    k: float


class Redundancy(NamedTuple):
    """When two candidates have the same monitoring signal at all times."""

    mirrored: bool
    """On every motion: the candidates lie opposite each other about the plant, (15)."""
    rates: tuple[float, ...]
    """Else on x(t) = x_0 exp(-rate t) alone, for these rates [1/s]: (12), (14) and (16)."""


def redundancy(gamma: Candidate, epsilon: Candidate, plant: Candidate) -> Redundancy:
    """When two candidates cannot be told apart on a plant without noise, Lemmas 1 and 2.

    Parameters
    ----------
    gamma, epsilon
        Two distinct candidates (b, k) [N s/m], [N/m]; one may be the plant itself.
    plant
        The true (b, k).

    Raises
    ------
    ValueError
        The candidates are the same.
    """
    if gamma == epsilon:
        raise ValueError(f"two distinct candidates are needed, got {gamma} twice")
    difference = (gamma.b - epsilon.b, gamma.k - epsilon.k)
    total = (gamma.b + epsilon.b - 2.0 * plant.b, gamma.k + epsilon.k - 2.0 * plant.k)
    rates = {k / b for b, k in (difference, total) if b != 0.0}
    return Redundancy(mirrored=total == (0.0, 0.0), rates=tuple(sorted(rates)))


class Ambiguity(NamedTuple):
    """What the data could not tell apart after each sample, arrays of shape (n,)."""

    candidates: Floats
    """How many candidates tie with the winner within the margin, the winner among them."""
    b_low: Floats
    """Least damping among them [N s/m]."""
    b_high: Floats
    k_low: Floats
    """Least stiffness among them [N/m]."""
    k_high: Floats


def ambiguity(
    estimator: MultiEstimator,
    x: Floats,
    v: Floats,
    f: Floats,
    dt: Floats,
    margin: float,
    every: int = 1,
) -> Ambiguity:
    """The set of candidates that a recording cannot tell apart, over time.

    Parameters
    ----------
    estimator
        The multi-estimator; it takes in the samples.
    x, v, f, dt
        Displacement [m], velocity [m/s], force [N] and time since the sample before [s], each
        of shape (n,).
    margin
        Share of the winner's monitoring signal by which a candidate may exceed it, >= 0.
    every
        Look after every so many samples; the arrays then have shape (n // every,).
    """
    b, k = estimator.grid.b.values, estimator.grid.k.values
    rows = []
    samples = zip(x.tolist(), v.tolist(), f.tolist(), dt.tolist(), strict=True)
    for n, (x_now, v_now, f_now, period) in enumerate(samples, start=1):
        estimator.update(x_now, v_now, f_now, period)
        if n % every == 0:
            first, last = estimator.tied_rows(margin)
            held = np.flatnonzero(first <= last)
            rows.append(
                (
                    (last[held] - first[held] + 1).sum(),
                    b[held[0]],
                    b[held[-1]],
                    k[first[held].min()],
                    k[last[held].max()],
                )
            )
    return Ambiguity(*np.array(rows, dtype=np.float64).reshape(-1, 5).T)
