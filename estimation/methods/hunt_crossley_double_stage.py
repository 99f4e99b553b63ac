"""Identify the Hunt-Crossley model in two stages, by two coupled least-squares problems."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, nan

from estimation.estimator import Estimator
from estimation.methods.hunt_crossley import (
    DAMPING,
    EXPONENT,
    HERTZ,
    LARGEST_LOG,
    NAMES,
    PRIOR,
    STEEPEST,
    STIFFNESS,
    TOUCH,
    check_contact,
    clamp,
)
from estimation.step import B, K, Regressors, State

LARGEST = 1e100
"""Largest magnitude of K x0^n and B x0^n v0 [N]."""
FARTHEST = 20.0
"""Upper limit of ln(x / x0)."""
LEAST_RELATIVE = 1e-30
"""Stage 2 uses a sample only if (K x0^n + B x0^n v) / f is larger than this value."""


@dataclass(frozen=True, slots=True)
class DoubleStageParameters:
    """Constant settings of the function `step`."""

    rate: float
    """1 / memory [1/s]."""
    x0: float
    """Typical displacement [m]."""
    v0: float
    """Typical velocity [m/s]."""
    threshold: float
    """A sample with this force or less is treated as no contact [N]."""
    log_x0: float
    """ln x0."""


@dataclass(slots=True)
class DoubleStageState(State):
    """Variables of the normal equations, with g = (x/x0)^n, u = v/v0 and l = ln(x/x0).

    x0 is the typical displacement, and v0 is the typical velocity.
    """

    gg: float
    """`gg` to `guf` are weighted sums of the products of g, g u and f, for stage 1."""
    ggu: float
    gugu: float
    gf: float
    guf: float
    ll: float
    """Weighted sum of l^2, for stage 2."""
    ly: float
    """Weighted sum of l y, for stage 2, with y = ln(f / (K x0^n + B x0^n v))."""
    prior: float
    """Weight of the initial guess of n."""


def step(
    parameters: DoubleStageParameters,
    state: DoubleStageState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update both stages, each with the latest estimate of the other stage."""
    v, x = phi
    if x / parameters.x0 < TOUCH or f <= parameters.threshold:
        state.held = True
        return
    lx, u = min(log(x / parameters.x0), FARTHEST), v / parameters.v0
    beta = exp(-dt * parameters.rate)
    n = state.theta[EXPONENT]
    stiffness, damping = first_stage(state, beta, exp(n * lx), u, f)
    n = second_stage(state, beta, n, lx, stiffness + damping * u, f)
    report(parameters, state, x, lx, stiffness, damping / parameters.v0, n)


def first_stage(
    state: DoubleStageState, beta: float, g: float, u: float, f: float
) -> tuple[float, float]:
    """Return K x0^n and B x0^n v0 [N] from a least-squares fit of f to the regressors g and g u."""
    gu = g * u
    state.gg = beta * state.gg + g * g
    state.ggu = beta * state.ggu + g * gu
    state.gugu = beta * state.gugu + gu * gu
    state.gf = beta * state.gf + g * f
    state.guf = beta * state.guf + gu * f
    mean = state.ggu / state.gg
    curvature = max(state.gugu - state.ggu * mean, 0.0) + PRIOR * state.gg
    damping = (state.guf - state.gf * mean) / curvature
    stiffness = state.gf / state.gg - damping * mean
    return clamp(stiffness, -LARGEST, LARGEST), clamp(damping, -LARGEST, LARGEST)


def second_stage(
    state: DoubleStageState, beta: float, n: float, lx: float, relative: float, f: float
) -> float:
    """Return the exponent n from a weighted least-squares fit of ln(f / relative) = n l.

    Here l = ln(x / x0) (`lx`). `relative` is the force [N] that the first stage predicts for the
    displacement x0 and the present velocity. The argument n is the previous estimate.

    The weight of a sample is f^2 (predicted / f)^(3/2). `predicted` is the force that the first
    stage and the previous n predict for this sample. The factor f^2 gives less weight to small
    forces, because the logarithm of a small force has more noise. The other factor removes the bias
    of the logarithm of a noisy force.
    """
    if relative <= LEAST_RELATIVE * f:
        return n
    y = log(f / relative)
    weight = f * f * exp(-1.5 * clamp(y - n * lx, -0.7, 0.7))
    state.ll = beta * state.ll + weight * lx * lx
    state.ly = beta * state.ly + weight * lx * y
    state.prior = beta * state.prior + weight * PRIOR
    return clamp((state.ly + HERTZ * state.prior) / (state.ll + state.prior), 0.0, STEEPEST)


def report(
    parameters: DoubleStageParameters,
    state: DoubleStageState,
    x: float,
    lx: float,
    stiffness: float,
    damping: float,
    n: float,
) -> None:
    """Compute the estimates b, k, K, B and n from `stiffness` K x0^n and `damping` B x0^n.

    b and k are the Kelvin-Voigt parameters at the displacement x of this sample.
    """
    theta = state.theta
    g = exp(n * lx)
    per_si = exp(clamp(-n * parameters.log_x0, -LARGEST_LOG, LARGEST_LOG))
    theta[B] = damping * g
    theta[K] = stiffness * g / x
    theta[STIFFNESS] = stiffness * per_si
    theta[DAMPING] = damping * per_si
    theta[EXPONENT] = n


class DoubleStage(Estimator):
    """Estimator of the Hunt-Crossley model f = K x^n + B x^n v by two coupled least squares.

        stage 1:    f = [x^n, x^n v] [K, B]'            with n from stage 2
        stage 2:    ln(f / (K + B v)) = n ln x          with K and B from stage 1

    Each stage is recursive least squares with exponential forgetting. b and k are the Kelvin-Voigt
    parameters at the present displacement: b = B x^n and k = K x^(n-1), so that b v + k x is the
    force. All standard deviations are NaN, because each stage neglects the error of the other
    stage.

    The model is valid in contact, for x > 0 and f > `threshold`, with the surface at x = 0. Stage
    2 also needs K + B v > 0. A sample for which K + B v <= 0 updates only K and B. The stages
    converge slowly if x varies little within the memory, because then K and n cannot be
    distinguished. The estimator `Logarithmic` does not have this problem: it has only one stage.

    References
    ----------
    N. Diolaiti, C. Melchiorri, S. Stramigioli, "Contact impedance estimation for robotic
    systems", IEEE Trans. Robotics 21(5), 2005 (the two stages). Two changes are not in this paper.
    x is divided by a typical displacement x0, so that its logarithm varies about zero. Stage 2 has
    weights that remove the bias of the logarithm of a noisy force.

    Parameters
    ----------
    memory
        Time [s] in which the weight of a sample decreases to 1/e.
    displacement, velocity
        Typical displacement x0 [m] and velocity v0 [m/s], used for scaling.
    threshold
        A sample with this force [N] or less, or with x < 1e-6 x0, does not change the estimate. The
        threshold must be > 0. A good value is one or two standard deviations of the force noise.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)

    def __init__(
        self,
        memory: float,
        displacement: float = 5e-3,
        velocity: float = 25e-3,
        threshold: float = 0.03,
    ) -> None:
        check_contact(memory, displacement, velocity, threshold)
        super().__init__(
            DoubleStageParameters(
                rate=1.0 / memory,
                x0=displacement,
                v0=velocity,
                threshold=threshold,
                log_x0=log(displacement),
            ),
            DoubleStageState([0.0, 0.0, 0.0, 0.0, HERTZ], [nan] * 5, False, *(0.0,) * 8),
            names=NAMES,
        )
