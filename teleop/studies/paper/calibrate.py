"""Calibrate the simulated rig from Table I: `python -m teleop.studies.paper.calibrate`.

The calibration uses b and k of the RLS rows under the conditions free and autonomous. These are
twelve numbers. The eight unknowns are k1 and k3 of each cube, whose force is k1 x + k3 x^3, the lag
of the force channel, and the lost motion of the slave. All other cells of Table I are predictions.
The calibration depends on four assumptions.

- Depths. Table I determines only k3 times the depth squared. The depths were chosen by trial and
  error such that the force errors, which increase with depth, are about equal to those of the
  paper. The force errors are therefore not independent predictions. Under `autonomous`, the depths
  are smaller, as the paper states. These smaller depths, and the frequency of 2 Hz, were chosen
  such that the rise time of adaptive identification (`ai`) with the paper's gains is about 0.6 s,
  as in the paper. The rise time of `ai` is therefore not an independent prediction. The paper does
  not state the depths under `mimic`, so the depths of `free` are used under `mimic`.
- Tremor. The tremor of the operator (`sim_backend/operators.py`) was also chosen to match the force
  errors. In the paper, the force errors on the soft and the medium cube are larger under `free` and
  `mimic` than under `autonomous`.
- Compliance. The compliance of the transmission is 7 um/N, which is typical of a cable or belt
  drive. The transmission is in series with the cube. Its compliance keeps the hard cube within the
  grid of the multi-estimator. Compliance and lost motion determine the friction, about 17 N.
- Damping. The true damping is 1.5 ms times k1. This gives a loss factor of 0.02 at 2 Hz, as for
  silicone rubber with little damping. To first order, damping and lag have the same effect on the
  force, and cannot be determined separately.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sim_backend import CUBES, DEPTH, FORCE_LAG, LOSS_TIME, TRANSMISSION, Cube, Setup
from teleop.names import ConditionName, CubeName
from teleop.studies.paper.table1 import CALIBRATED, table1
from teleop.studies.paper.trials import paper_trial
from teleop.studies.workers import workers
from teleop.trial.run import run_trial

K_TOLERANCE = 0.02
"""Relative error of k that adds 1 to the sum of squares."""
B_TOLERANCE = 0.3
"""Error of the natural logarithm of b that adds 1 to the sum of squares."""
STEP = 0.03
"""Step of the numerical derivatives, as a fraction of the value."""
EVALUATIONS = 5
"""Largest number of evaluations of the residuals, not counting those for the derivatives."""
Vector = NDArray[np.float64]

TRIALS = [(condition, cube) for cube in CUBES for condition in CALIBRATED]


def rls_averages(condition: ConditionName, cube: CubeName, setup: Setup) -> tuple[float, float]:
    """Run a trial of the paper, and return the averages of b [N s/m] and k [N/m] from RLS.

    Parameters
    ----------
    condition, cube
        Names of condition and cube.
    setup
        Cube, force channel, depth and transmission that replace those of the simulated rig.
    """
    settings = replace(paper_trial(condition, cube), custom_setup=setup, estimators=("rls",))
    columns = run_trial(settings).columns
    return float(columns["rls_b"].mean()), float(columns["rls_k"].mean())


def setups(values: Vector) -> dict[tuple[str, str], Setup]:
    """Return the simulated setup of each trial, by condition and cube.

    Parameters
    ----------
    values
        k1 of the three cubes [N/m], k3 of the three cubes [N/m^3], lag [s] and lost motion [m],
        shape (8,).
    """
    k1, k3, (lag, lost_motion) = values[:3], values[3:6], values[6:].tolist()
    cubes = {
        name: Cube(a, c, LOSS_TIME * a)
        for name, a, c in zip(CUBES, k1.tolist(), k3.tolist(), strict=True)
    }
    transmission = replace(TRANSMISSION, lost_motion=lost_motion)
    return {
        (condition, cube): Setup(cubes[cube], lag, DEPTH[condition][cube], transmission)
        for condition, cube in TRIALS
    }


def averages(values: Vector, pool: Executor) -> Mapping[tuple[str, str], tuple[float, float]]:
    """Return the averages of b [N s/m] and k [N/m] from RLS, by condition and cube of the trial."""
    made = setups(values)
    conditions, cubes = zip(*TRIALS, strict=True)
    results = pool.map(rls_averages, conditions, cubes, [made[trial] for trial in TRIALS])
    return dict(zip(TRIALS, results, strict=True))


def calibrate(start: Vector, pool: Executor) -> Vector:
    """Return the values of `setups` for which the RLS averages are closest to those of the paper.

    Parameters
    ----------
    start
        First guess of the values, in the order of `setups`, shape (8,).
    pool
        Pool of processes that run the trials.
    """

    def residuals(logarithms: Vector) -> Vector:
        out = []
        for trial, (b, k) in averages(start * np.exp(logarithms), pool).items():
            paper = table1()[*trial, "rls"]
            out += [(k / paper.k - 1.0) / K_TOLERANCE, np.log(max(b / paper.b, 0.05)) / B_TOLERANCE]
        return np.array(out)

    def slopes(logarithms: Vector) -> Vector:
        """Return the Jacobian.

        Five evaluations are sufficient, because k1 and k3 of a cube affect only its own trials:
        the values of all cubes are changed together.
        """
        here = residuals(logarithms)
        out = np.zeros((len(here), len(start)))
        own = np.repeat(np.eye(len(CUBES)), len(here) // len(CUBES), axis=0)
        for moved, mask in (
            (slice(0, 3), own),
            (slice(3, 6), own),
            (slice(6, 7), 1.0),
            (slice(7, 8), 1.0),
        ):
            there = logarithms.copy()
            there[moved] += STEP
            out[:, moved] = mask * ((residuals(there) - here) / STEP)[:, None]
        return out

    fit = least_squares(residuals, np.zeros(len(start)), jac=slopes, max_nfev=EVALUATIONS)
    found: Vector = start * np.exp(fit.x)
    return found


def main() -> None:
    """Print the values for `sim_backend/paper_rig.py`, and the RLS averages of rig and paper."""
    start = np.array(
        [
            *(cube.k1 for cube in CUBES.values()),
            *(cube.k3 for cube in CUBES.values()),
            FORCE_LAG,
            TRANSMISSION.lost_motion,
        ]
    )
    with workers() as pool:
        values = calibrate(start, pool)
        found = averages(values, pool)
    for name, k1, k3 in zip(CUBES, values[:3], values[3:6], strict=True):
        print(f"{name}: k1 {k1:.4g}, k3 {k3:.4g}")
    print(f"lag {values[6]:.3g} s, lost motion {values[7]:.3g} m")
    for (condition, cube), (b, k) in found.items():
        paper = table1()[condition, cube, "rls"]
        print(f"{condition} {cube}: k {k:.0f} (paper {paper.k:.0f}), b {b:.1f} ({paper.b:.1f})")


if __name__ == "__main__":
    main()
