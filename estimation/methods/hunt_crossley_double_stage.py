"""Double-stage identification of the Hunt-Crossley model: two coupled least squares."""

from __future__ import annotations

from math import exp, log, nan

from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import Estimator
from estimation.methods.hunt_crossley_logarithmic import (
    HERTZ,
    LARGEST_LOG,
    NAMES,
    PRIOR,
    STEEPEST,
    TOUCH,
    check_contact,
)

LARGEST = 1e100
"""Largest K x0^n and B x0^n v0 [N]."""
FARTHEST = 20.0
"""Largest logarithm of a displacement, by the typical one."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Both stages, each with the other's latest estimate, of lx = ln x/x0 and u = v/v0.

    Their normal equations are kept: of (e^(n lx), e^(n lx) u) from state[11] on, of lx from
    state[16] on.
    """
    x = phi[1] / parameters[1]
    if x < TOUCH or f <= parameters[3]:
        state[10] = 1.0
        return
    n = state[4]
    lx, u = min(log(x), FARTHEST), phi[0] / parameters[2]
    beta = exp(-dt * parameters[0])
    g = exp(n * lx)
    gu = g * u
    state[11] = beta * state[11] + g * g
    state[12] = beta * state[12] + g * gu
    state[13] = beta * state[13] + gu * gu
    state[14] = beta * state[14] + g * f
    state[15] = beta * state[15] + gu * f
    mean = state[12] / state[11]
    curvature = max(state[13] - state[12] * mean, 0.0) + PRIOR * state[11]
    damping = (state[15] - state[14] * mean) / curvature
    stiffness = state[14] / state[11] - damping * mean
    damping = min(max(damping, -LARGEST), LARGEST)
    stiffness = min(max(stiffness, -LARGEST), LARGEST)

    relative = stiffness + damping * u
    if relative > 1e-30 * f:
        y = log(f / relative)
        weight = f * f * exp(-1.5 * min(max(y - n * lx, -0.7), 0.7))
        state[16] = beta * state[16] + weight * lx * lx
        state[17] = beta * state[17] + weight * lx * y
        state[18] = beta * state[18] + weight * PRIOR
        n = (state[17] + HERTZ * state[18]) / (state[16] + state[18])
        n = min(max(n, 0.0), STEEPEST)
        g = exp(n * lx)
    per_si = exp(min(max(-n * parameters[4], -LARGEST_LOG), LARGEST_LOG))
    damping /= parameters[2]
    state[0] = damping * g
    state[1] = stiffness * g / phi[1]
    state[2] = stiffness * per_si
    state[3] = damping * per_si
    state[4] = n


class DoubleStage(Estimator):
    """Hunt-Crossley f = K x^n + B x^n v by two coupled recursive least squares.

        stage 1:    f = [x^n, x^n v] [K, B]'            with n of stage 2
        stage 2:    ln (f / (K + B v)) = n ln x         with K and B of stage 1

    each by exponentially forgetting least squares. b and k are what Kelvin-Voigt reads at the
    present displacement: b = B x^n and k = K x^(n-1), so that b v + k x is the force. There is
    no interval, since neither stage knows of the other's error: all deviations are NaN.

    It is valid in contact, x > 0 and f > `threshold`, with the surface at x = 0, and for stage
    2 where K + B v > 0; a sample of which that is not true moves only K and B. The coupling
    must be weak: the stages converge the slower, the less x varies within the memory, as K and
    n then tell the same. `Logarithmic` has no such coupling.

    References
    ----------
    N. Diolaiti, C. Melchiorri, S. Stramigioli, "Contact impedance estimation for robotic
    systems", IEEE Trans. Robotics 21(5), 2005 (the two stages). Ours are the typical
    displacement x0 by which x is divided inside, so that ln x varies about zero, and the
    weights of stage 2, which rid it of the bias of a noisy force's logarithm.

    Parameters
    ----------
    memory
        Time [s] over which a sample's weight falls by e.
    displacement, velocity
        Typical ones, x0 [m] and v0 [m/s], by which both are divided inside.
    threshold
        Force [N] up to which a sample is taken for no contact, > 0: one or two deviations of
        its noise. So is a sample with x <= 0. The estimate is held then.

    Raises
    ------
    ValueError
        A parameter is out of its range.
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
            (1.0 / memory, displacement, velocity, threshold, log(displacement)),
            (0.0, 0.0, 0.0, 0.0, HERTZ, *[nan] * 5, *[0.0] * 9),
            names=NAMES,
        )
