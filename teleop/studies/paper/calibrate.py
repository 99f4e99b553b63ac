"""Calibrate the simulated rig from Table I: `python -m teleop.studies.paper.calibrate`.

The calibration uses the values of b and k that Table I states for RLS under the conditions `free`
and `autonomous`. These are twelve numbers. The calibration finds eight unknowns: k1 and k3 of each
of the three cubes, the lag of the force channel, and the lost motion of the slave. The force of a
cube at the displacement x is k1 x + k3 x^3. All other cells of Table I are predictions. The
calibration depends on four assumptions.

- Depths. Table I determines only the product of k3 and the squared depth. The depths were chosen by
  trial and error such that the force errors are about equal to those of the paper. The force errors
  increase with the depth. They are therefore not independent predictions. The paper states that the
  depths are smaller under `autonomous`. These smaller depths, and the frequency of 2 Hz, were
  chosen such that the rise time of adaptive identification (`ai`) with the paper's gains is about
  0.6 s, as in the paper. The rise time of `ai` is therefore not an independent prediction. The
  paper does not state the depths under `mimic`. The depths of `free` are used there.
- Tremor. The tremor of the operator (`sim_backend/operators.py`) was also chosen to match the force
  errors. In the paper, the force errors on the soft and the medium cube are larger under `free` and
  `mimic` than under `autonomous`.
- Compliance. The compliance of the transmission is 7 um/N, which is typical of a cable or belt
  drive. The transmission is in series with the cube, and reduces the estimated stiffness. For the
  hard cube, the estimate is therefore within the grid of the multi-estimator. The friction of the
  transmission follows from its compliance and its lost motion. It is about 17 N.
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
    """Return the eight unknowns for which the RLS averages are closest to those of the paper.

    The unknowns are the parameter `values` of the function `setups`.

    Parameters
    ----------
    start
        Initial values of the unknowns, in the same order, shape (8,).
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
        """Return the Jacobian of the residuals.

        k1 and k3 of a cube affect only the trials on this cube. The values of all three cubes can
        therefore be changed at the same time, and five evaluations of the residuals are sufficient.
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
    """Calibrate the simulated rig, and print the calibrated values.

    The values are intended for the file `sim_backend/paper_rig.py`. The averages of b and k from
    RLS are also printed, for the simulated rig and for the paper.
    """
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
