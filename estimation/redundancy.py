"""Parameterisation redundancy: candidates (b, k) that a motion does not distinguish.

This is the subject of Lemmas 1 and 2 of the paper.

With theta = (b, k), phi = [v, x] and the plant theta_0, the force error of a candidate is
(theta - theta_0)' phi, and its monitoring signal (11) is the quadratic form

    mu(theta) = (theta - theta_0)' S (theta - theta_0)
    S = int e^(-2 lambda (t - tau)) phi phi' dtau.

For two candidates gamma and epsilon, with difference d = gamma - epsilon and sum of errors
s = (gamma - theta_0) + (epsilon - theta_0),

    mu_gamma - mu_epsilon = d' S s = int e^(-2 lambda (t - tau)) (d' phi)(s' phi) dtau,

which is zero at all times if and only if (d' phi)(s' phi) is zero at all times. There are three
cases: s = 0, the mirrored pair (15); d' phi = 0, the exponential motion (14); and s' phi = 0, the
exponential motion (16). In Lemma 1 epsilon is the plant, so d = s, and (14) becomes (12). The
paper's additional condition for (16), that the two errors are parallel, is not needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from estimation.methods.multi_estimator import MultiEstimator


class Candidate(NamedTuple):
    """Damping `b` [N s/m] and stiffness `k` [N/m] of a candidate, or of the true environment."""

    b: float
    k: float


class Redundancy(NamedTuple):
    """Motions for which two candidates have the same monitoring signal at all times."""

    mirrored: bool
    """True if the signals are the same for every motion: the plant is the midpoint between the
    candidates, (15)."""
    rates: tuple[float, ...]
    """Rates [1/s] for which the signals are the same in x(t) = x_0 exp(-rate t), (12), (14), (16).
    """


def redundancy(gamma: Candidate, epsilon: Candidate, plant: Candidate) -> Redundancy:
    """Return the motions for which two candidates cannot be distinguished, Lemmas 1 and 2.

    The measurements are assumed to have no noise.

    Parameters
    ----------
    gamma, epsilon
        Two different candidates (b, k) [N s/m], [N/m]. One candidate may be equal to the plant.
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
    """Range of the candidates that the data do not distinguish, arrays over time, shape (n,)."""

    candidates: Floats
    """Number of candidates within the margin of the best candidate, including the best one."""
    b_low: Floats
    """Smallest damping of the candidates within the margin [N s/m]."""
    b_high: Floats
    """Largest damping of the candidates within the margin [N s/m]."""
    k_low: Floats
    """Smallest stiffness of the candidates within the margin [N/m]."""
    k_high: Floats
    """Largest stiffness of the candidates within the margin [N/m]."""


def ambiguity(
    estimator: MultiEstimator,
    x: Floats,
    v: Floats,
    f: Floats,
    dt: Floats,
    margin: float,
    every: int = 1,
) -> Ambiguity:
    """Return the range of the candidates that a recording does not distinguish, over time.

    Parameters
    ----------
    estimator
        The multi-estimator. It processes the samples.
    x, v, f, dt
        Displacement [m], velocity [m/s], force [N] and time since the previous sample [s], each
        of shape (n,).
    margin
        A candidate is not distinguished from the best candidate if the difference of their
        monitoring signals is at most this fraction of the smallest signal, >= 0.
    every
        Number of samples per row of the result; the arrays have the shape (n // every,).
    """
    b, k = estimator.grid.b.values, estimator.grid.k.values
    rows = []
    samples = zip(x.tolist(), v.tolist(), f.tolist(), dt.tolist(), strict=True)
    for n, (x_now, v_now, f_now, period) in enumerate(samples, start=1):
        estimator.update(x_now, v_now, f_now, period)
        if n % every == 0:
            first, last = estimator.tied_rows(margin)
            tied = np.flatnonzero(first <= last)
            rows.append(
                (
                    (last[tied] - first[tied] + 1).sum(),
                    b[tied[0]],
                    b[tied[-1]],
                    k[first[tied].min()],
                    k[last[tied].max()],
                )
            )
    return Ambiguity(*np.array(rows, dtype=np.float64).reshape(-1, 5).T)
