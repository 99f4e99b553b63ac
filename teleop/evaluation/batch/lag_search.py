"""Find a lag of the force that explains a record better than relaxation.

A lag T of the force changes the complex stiffness k + i omega b of a body to (k + i omega b)
exp(-i omega T). Its real part grows with the frequency by about (b T - k T^2 / 2) omega^2, as that
of a body whose force relaxes. With one frequency, the two cannot be distinguished. With several,
they can, because the imaginary part of a relaxing body decreases at high frequencies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from estimation.arrays import Floats
from estimation.robust_error import RobustFit, bayesian_criterion
from teleop.evaluation.batch.candidate import Candidate
from teleop.evaluation.batch.regression_rows import RegressionRows
from teleop.evaluation.batch.thresholds import BETTER_BIC, LAG_MISFIT, LONGEST_LAG

LAGS = 11
"""Number of lags on the grid from 0 to `LONGEST_LAG`, before the lag is refined."""


class ForceLag(NamedTuple):
    """A lag of the force, with the stiffness and the damping of a body without relaxation."""

    seconds: float
    """Lag of the force behind the position, besides a compensated one [s]."""
    k: float
    """Stiffness at the position of k of the record [N/m]."""
    b: float
    """Damping [N s/m]."""


def lag_instead_of_relaxation(rows: RegressionRows, best: Candidate) -> ForceLag | None:
    """Return the lag that describes the force at least as well as the relaxing parts of a model.

    The result is None if the relaxing parts describe it better, if the model has none, if the force
    is described as well without any lag, or if the lag leaves a residual that noise does not
    explain.
    """
    record = rows.record
    if not best.times or best.extensions or best.is_storage:  # k' and k'' of one frequency
        return None
    depth = rows.normalised(record.raw_x)
    powers = range(1, best.degree + 1)
    signals = [rows.velocity, *(record.smoothed(depth**n) for n in powers)]

    def fit(lag: float) -> RobustFit:
        columns = [delayed(rows, signal, lag)[rows.index] for signal in signals]
        return rows.fits.fit(np.column_stack(columns))

    def squares(lag: float) -> float:
        return float(np.sum(fit(lag).residual ** 2))

    grid = np.linspace(0.0, LONGEST_LAG, LAGS)
    near = int(np.clip(np.argmin([squares(lag) for lag in grid]), 1, LAGS - 2))
    bounds = (float(grid[near - 1]), float(grid[near + 1]))
    lag = float(minimize_scalar(squares, bounds=bounds, method="bounded").x)
    found, plain = fit(lag), fit(0.0)
    bic = bayesian_criterion(found.residual, len(found.theta) + 1)
    if bic > bayesian_criterion(plain.residual, len(plain.theta)) - BETTER_BIC:
        return None
    b = float(found.theta[rows.v_column])
    rms = float(np.sqrt(np.mean(found.residual**2)))
    if bic > best.bic + BETTER_BIC or b < 0.0 or rms > LAG_MISFIT * record.f_noise_smoothed:
        return None
    s = (best.position - rows.origin) / rows.scale
    slopes = np.array([n * s ** (n - 1) for n in powers]) / rows.scale
    return ForceLag(lag, float(slopes @ found.theta[rows.v_column + 1 :]), b)


def delayed(rows: RegressionRows, signal: Floats, lag: float) -> Floats:
    """Return a signal that is delayed, separately in each piece between gaps."""
    record = rows.record
    pieces = zip(
        np.split(record.clock, record.starts[1:]), np.split(signal, record.starts[1:]), strict=True
    )
    return np.concatenate([np.interp(clock - lag, clock, piece) for clock, piece in pieces])
