"""Identify the Hunt-Crossley model f = K x^n + B x^n v by two coupled least-squares fits."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, nan
from typing import Self

from estimation.estimator import Estimator
from estimation.method_settings import SIZES, MethodSettings
from estimation.methods.hunt_crossley import (
    CONTACT_FORCE,
    DAMPING,
    EXPONENT,
    HERTZ,
    LARGEST_LOG,
    NAMES,
    PRIOR,
    STEEPEST,
    STIFFNESS,
    TOUCH,
    HuntCrossleyParameters,
    clamp,
    contact_parameters,
)
from estimation.step import B, K, Regressors, State

LARGEST = 1e100
"""Largest magnitude of K x0^n and B x0^n v0 [N]."""
FARTHEST = 20.0
"""Upper limit of ln(x / x0)."""
LEAST_RELATIVE = 1e-30
"""The fit of ln f uses a sample only if (K x0^n + B x0^n v) / f is larger than this value."""


@dataclass(slots=True)
class DoubleStageState(State):
    """Sums for the two least-squares fits, with g = (x/x0)^n, u = v/v0 and l = ln(x/x0).

    x0 is the typical displacement, v0 is the typical velocity, and n is the estimated exponent.
    """

    gg: float
    """`gg` to `guf` are sums of products of g, g u and f over the samples, for the first fit. The
    weights of the samples decay exponentially."""
    ggu: float
    gugu: float
    gf: float
    guf: float
    ll: float
    """Weighted sum of l^2, for the second fit."""
    ly: float
    """Weighted sum of l y, for the second fit, with y = ln(f / (K x0^n + B x0^n v))."""
    prior: float
    """Weight of the initial guess of n."""


def step(
    parameters: HuntCrossleyParameters,
    state: DoubleStageState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update K and B by least squares on f, and then update n by least squares on ln f.

    The model is f = K x^n + B x^n v. The fit of K and B uses the n of the previous sample. The fit
    of n uses the new K and B. A sample without contact changes nothing; `held` is then set to True.
    """
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
    """Update the least-squares fit of the force, with the exponent n of the previous sample.

    The model f = K x^n + B x^n v is written as f = (K x0^n) g + (B x0^n v0) g u, with g = (x/x0)^n
    and u = v/v0. x0 and v0 are the typical displacement and velocity. `beta` is the forgetting
    factor, by which the sums of the earlier samples are multiplied.

    The result is K x0^n and B x0^n v0 [N].
    """
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
    """Update the weighted least-squares fit of the logarithm of the force. Return the exponent n.

    The fit is ln(f / relative) = n ln(x / x0), where x0 is the typical displacement.

    The weight of a sample is f^2 (predicted / f)^(3/2), with predicted = relative (x / x0)^n and
    the previous n. The factor f^2 gives less weight to small forces, because the logarithm of a
    small force has more noise. The other factor removes the bias of the logarithm of a noisy force.

    `lx` is ln(x / x0). `relative` is the force [N] at the displacement x0 and the present velocity,
    with the K and B of the first stage. If it is negative or near zero, n does not change.
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
    parameters: HuntCrossleyParameters,
    state: DoubleStageState,
    x: float,
    lx: float,
    stiffness: float,
    damping: float,
    n: float,
) -> None:
    """Compute the estimates b, k, K, B and n, and store them in the state.

    b and k are the Kelvin-Voigt parameters at the displacement x [m] of this sample. The other
    arguments are lx = ln(x / x0), `stiffness` = K x0^n [N], `damping` = B x0^n [N s/m] and the
    exponent n. x0 is the typical displacement.
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
    """Estimator of the Hunt-Crossley model f = K x^n + B x^n v by two coupled least-squares fits.

        stage 1:    f = [x^n, x^n v] [K, B]'            with n from stage 2
        stage 2:    ln(f / (K + B v)) = n ln x          with K and B from stage 1

    Each stage is recursive least squares with exponential forgetting. b and k are the Kelvin-Voigt
    parameters at the present displacement: b = B x^n and k = K x^(n-1), so that b v + k x is the
    force. All standard deviations are NaN, because each stage treats the result of the other stage
    as exact.

    The model is valid in contact, for x > 0 and f > `threshold`, with the surface at x = 0. Stage
    2 also needs K + B v > 0. A sample for which K + B v <= 0 updates only K and B. The stages
    converge slowly if x varies little within the time `memory`, because K and n can then hardly be
    distinguished. The estimator `Logarithmic` does not have this problem, because it estimates all
    parameters in one stage.

    References
    ----------
    N. Diolaiti, C. Melchiorri, S. Stramigioli, "Contact impedance estimation for robotic
    systems", IEEE Trans. Robotics 21(5), 2005, is the source of the two stages. Two features are
    not in this paper. First, x is divided by a typical displacement x0, so that ln(x / x0) varies
    about zero. Second, stage 2 has weights that remove the bias of the logarithm of a noisy force.

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
    used_settings = ("forgetting", *SIZES)

    def __init__(
        self,
        memory: float,
        displacement: float = 5e-3,
        velocity: float = 25e-3,
        threshold: float = 0.03,
    ) -> None:
        super().__init__(
            HuntCrossleyParameters(**contact_parameters(memory, displacement, velocity, threshold)),
            DoubleStageState([0.0, 0.0, 0.0, 0.0, HERTZ], [nan] * 5, False, *(0.0,) * 8),
            names=NAMES,
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            settings.memory, settings.x_size, settings.v_size, CONTACT_FORCE * settings.f_size
        )
