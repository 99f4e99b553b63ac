"""Find candidates (b, k) that a motion does not distinguish (parameterisation redundancy).

The candidates are those of the multi-estimator. It selects the candidate with the smallest
monitoring signal, which is a weighted integral of the squared force error. A motion does not
distinguish two candidates if their monitoring signals are equal at all times. Lemmas 1 and 2 of the
paper describe these motions. The numbers in brackets below are equation numbers of the paper.

Let phi = [v, x], let theta = (b, k) be a candidate, and let theta_0 be the plant: the true (b, k).
Without noise, the force error of the candidate is (theta - theta_0)' phi. With the forgetting rate
lambda, its monitoring signal (11) is

    mu(theta) = (theta - theta_0)' S (theta - theta_0)
    S = int e^(-2 lambda (t - tau)) phi phi' dtau.

Let gamma and epsilon be two candidates. Let d = gamma - epsilon be their difference, and let
s = (gamma - theta_0) + (epsilon - theta_0) be the sum of their errors. Then

    mu(gamma) - mu(epsilon) = d' S s = int e^(-2 lambda (t - tau)) (d' phi)(s' phi) dtau.

This difference is zero at all times if and only if (d' phi)(s' phi) is zero at all times. There are
three cases:

- s = 0: the plant is the midpoint between the candidates (15). The motion can be any motion;
- d' phi = 0: x is an exponential function of time (14). If epsilon is the plant, this is (12);
- s' phi = 0: x is an exponential function of time with another rate (16). In the paper, (16) has
  the condition that gamma - theta_0 and epsilon - theta_0 are parallel, which is not necessary.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.methods.multi_estimator import MultiEstimator


class Candidate(NamedTuple):
    """A pair of damping `b` [N s/m] and stiffness `k` [N/m].

    It is one of the pairs from which the multi-estimator selects its estimate, or the true pair of
    the environment.
    """

    b: float
    k: float


class Redundancy(NamedTuple):
    """Motions that do not distinguish two candidates (b, k) of the multi-estimator.

    In such a motion, the monitoring signals of both candidates are equal at all times. The
    multi-estimator selects the candidate with the smallest monitoring signal (a weighted integral
    of the squared force error). So it cannot select between the two candidates.
    """

    mirrored: bool
    """True if the two signals are equal in every motion, equation (15) of the paper. The true
    (b, k) is then the midpoint between the candidates."""
    rates: tuple[float, ...]
    """The two signals are equal in a motion x(t) = x_0 exp(-rate t) with one of these rates [1/s],
    equations (12), (14) and (16) of the paper."""


def redundancy(gamma: Candidate, epsilon: Candidate, plant: Candidate) -> Redundancy:
    """Return the motions that do not distinguish two candidates of the multi-estimator.

    The result is that of Lemmas 1 and 2 of the paper, for measurements without noise.

    Parameters
    ----------
    gamma, epsilon
        Two different candidates (b, k), in N s/m and N/m. One of them may be equal to `plant`.
    plant
        The true (b, k) of the environment, in N s/m and N/m.

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
    """Estimate of the multi-estimator, and range of the candidates that fit almost as well.

    The estimate is the best candidate: the candidate (b, k) with the smallest monitoring signal (a
    weighted integral of the squared force error). A candidate fits almost as well if its signal
    is larger by at most a given relative margin. Each field has the shape (n,), with one value for
    each of n times.
    """

    b: Floats
    """Damping of the best candidate [N s/m]."""
    k: Floats
    """Stiffness of the best candidate [N/m]."""
    candidates: Floats
    """Number of candidates within the margin, including the best candidate."""
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
    """Process a recording; return the candidates that fit almost as well as the best candidate.

    The best candidate is the candidate (b, k) with the smallest monitoring signal (a weighted
    integral of the squared force error). The result contains the best candidate. It also contains
    the number of candidates that fit almost as well, the range of their b, and the range of their
    k. All these values are returned as arrays over time.

    Parameters
    ----------
    estimator
        The multi-estimator that processes the samples.
    x, v, f, dt
        Displacement [m], velocity [m/s], force [N] and time since the previous sample [s], each
        of shape (n,).
    margin
        A candidate fits almost as well if its monitoring signal is at most (1 + margin) times the
        signal of the best candidate, margin >= 0.
    every
        Number of samples between two times in the result. The returned arrays have the shape
        (n // every,).
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
