"""Find candidates (b, k) that a motion does not distinguish (parameterisation redundancy).

Lemmas 1 and 2 of the paper describe these candidates. The equation numbers are those of the paper.

Let theta = (b, k), let phi = [v, x], and let theta_0 be the plant, the true (b, k). The force error
of a candidate theta is (theta - theta_0)' phi. Its monitoring signal (11) is the quadratic form

    mu(theta) = (theta - theta_0)' S (theta - theta_0)
    S = int e^(-2 lambda (t - tau)) phi phi' dtau.

Let d = gamma - epsilon be the difference of two candidates gamma and epsilon, and let
s = (gamma - theta_0) + (epsilon - theta_0) be the sum of their errors. Then

    mu_gamma - mu_epsilon = d' S s = int e^(-2 lambda (t - tau)) (d' phi)(s' phi) dtau,

which is zero at all times if and only if (d' phi)(s' phi) is zero at all times. There are three
cases: s = 0, the mirrored pair (15); d' phi = 0, the exponential motion (14); and s' phi = 0, the
exponential motion (16). In Lemma 1 epsilon is the plant, so d = s, and (14) becomes (12). For (16)
the paper has the additional condition that the two errors are parallel. This condition is not
needed.
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
    """Motions that do not distinguish two candidates (b, k) of the multi-estimator.

    For such a motion, both candidates have the same monitoring signal (11) at all times.
    """

    mirrored: bool
    """True if the two signals are the same for every motion, (15). In this case the plant is the
    midpoint between the candidates."""
    rates: tuple[float, ...]
    """The two signals are the same in a motion x(t) = x_0 exp(-rate t) with one of these rates
    [1/s], (12), (14), (16)."""


def redundancy(gamma: Candidate, epsilon: Candidate, plant: Candidate) -> Redundancy:
    """Return the motions for which two candidates cannot be distinguished, Lemmas 1 and 2.

    The measurements are assumed to have no noise.

    Parameters
    ----------
    gamma, epsilon
        Two different candidates (b, k) [N s/m], [N/m]. One candidate may be equal to the plant.
    plant
        The true (b, k) of the environment.

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
    """Best candidate, and range of the candidates that the data do not distinguish from it.

    The best candidate is the candidate with the smallest monitoring signal. It is the estimate of
    the multi-estimator. Each field is an array over time, of shape (n,).
    """

    b: Floats
    """Damping of the best candidate [N s/m]."""
    k: Floats
    """Stiffness of the best candidate [N/m]."""
    candidates: Floats
    """Number of candidates within the margin of the best candidate, which is also counted."""
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
    """Process a recording; return the range of the candidates that the data do not distinguish.

    The best candidate is the candidate with the smallest monitoring signal. The result describes
    the candidates that the data do not distinguish from the best candidate. It contains their
    number, the range of their b and the range of their k, over time.

    Parameters
    ----------
    estimator
        The multi-estimator that processes the samples.
    x, v, f, dt
        Displacement [m], velocity [m/s], force [N] and time since the previous sample [s], each
        of shape (n,).
    margin
        A candidate is not distinguished from the best candidate if its monitoring signal is at most
        (1 + margin) times the signal of the best candidate, margin >= 0.
    every
        The candidates are determined once after every `every` samples. The returned arrays have the
        shape (n // every,).
    """
    b, k = estimator.grid.b.values, estimator.grid.k.values
    rows = []
    for start in range(0, len(x) - every + 1, every):
        block = (channel[start : start + every].tolist() for channel in (x, v, f, dt))
        for sample in zip(*block, strict=True):
            best = estimator.update(*sample)
        first, last = estimator.tied_rows(margin)
        tied = np.flatnonzero(first <= last)
        rows.append(
            (
                best.b,
                best.k,
                (last[tied] - first[tied] + 1).sum(),
                b[tied[0]],
                b[tied[-1]],
                k[first[tied].min()],
                k[last[tied].max()],
            )
        )
    return Ambiguity(*np.array(rows, dtype=np.float64).reshape(-1, 7).T)
