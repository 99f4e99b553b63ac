"""Calibrate the simulated rig to the paper's Table I: `python -m teleop.studies.paper.calibrate`.

The calibration uses the values of b and k that Table I states for recursive least squares (RLS)
under the conditions `free` and `autonomous`. These are twelve numbers. The calibration finds eight
unknowns: k1 and k3 of each of the three cubes, the lag of the force channel, and the lost motion of
the slave. The elastic force of a cube at the displacement x is k1 x + k3 x^3. All other cells of
Table I are predictions. The calibration depends on four assumptions, which are constants in
`sim_backend`.

- Depths of palpation (`DEPTH`). Table I determines only the product of k3 and the squared depth.
  The depths were chosen by trial and error such that the force errors are about equal to those of
  the paper. The force errors increase with the depth. They are therefore not independent
  predictions. The paper states that the depths are smaller under `autonomous`. The depths and the
  frequency under `autonomous` were chosen such that the rise time of adaptive identification (`ai`)
  with the paper's gains is about equal to that in the paper. The rise time of `ai` is therefore not
  an independent prediction. The paper does not state the depths under `mimic`. They are assumed to
  be equal to those under `free`.
- Tremor of the operator (`sim_backend/operators.py`). The tremor was also chosen such that the
  force errors are about equal to those of the paper. In the paper, the force errors on the soft and
  the medium cube are larger under `free` and `mimic` than under `autonomous`.
- Compliance of the slave's transmission (`TRANSMISSION`). The value is typical of a cable or belt
  drive. The transmission is in series with the cube, and reduces the estimated stiffness. For the
  hard cube, the estimate is therefore within the grid of the candidates of the multi-estimator. The
  friction of the transmission is its lost motion divided by its compliance.
- Damping of the cubes. The true damping is `LOSS_TIME` times k1. This gives a low loss factor, as
  for silicone rubber with little damping. To first order, damping and lag have the same effect on
  the force, and cannot be determined separately.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sim_backend import CUBES, DEPTH, FORCE_LAG, LOSS_TIME, TRANSMISSION, Cube, Setup
from teleop.control.conditions import CONDITIONS
from teleop.names import ConditionName, CubeName
from teleop.studies.paper.table1 import CALIBRATED, table1
from teleop.studies.paper.trials import paper_trial
from teleop.studies.workers import workers
from teleop.trial.run import run_trial

K_TOLERANCE = 0.02
"""Relative error of k that adds 1 to the sum of the squared residuals of the calibration."""
B_TOLERANCE = 0.3
"""Error of the natural logarithm of |b| that adds 1 to the sum of the squared residuals."""
STEP = 0.03
"""Step of the numerical derivatives, as a fraction of the value."""
EVALUATIONS = 5
"""Largest number of evaluations of the residuals, not counting those for the derivatives."""
Vector = NDArray[np.float64]

TRIALS = [(condition, cube) for cube in CUBES for condition in CALIBRATED]
"""Condition and cube of each trial of the calibration."""


def rls_averages(condition: ConditionName, cube: CubeName, setup: Setup) -> tuple[float, float]:
    """Run a trial of the paper, and return the averages of b [N s/m] and k [N/m] from RLS.

    RLS is recursive least squares, one of the estimators of the paper.
    """
    settings = replace(paper_trial(condition, cube), custom_setup=setup, estimators=("rls",))
    columns = run_trial(settings).columns
    return float(columns["rls_b"].mean()), float(columns["rls_k"].mean())


def setups(values: Vector) -> dict[tuple[str, str], Setup]:
    """Return the properties of rig and cube in each trial, by (condition, cube).

    The eight unknowns are k1 of the three cubes [N/m], k3 of the three cubes [N/m^3], the lag of
    the force channel [s], and the lost motion of the slave [m]. The elastic force of a cube is
    k1 x + k3 x^3.
    """
    k1, k3, (lag, lost_motion) = values[:3], values[3:6], values[6:].tolist()
    cubes = {
        name: Cube(a, c, LOSS_TIME * a)
        for name, a, c in zip(CUBES, k1.tolist(), k3.tolist(), strict=True)
    }
    transmission = replace(TRANSMISSION, lost_motion=lost_motion)
    return {
        (condition, cube): Setup(cubes[cube], lag, DEPTH[moved_by][cube], transmission)
        for condition, cube in TRIALS
        for moved_by in [CONDITIONS[condition].moved_by]
    }


def averages(values: Vector, pool: Executor) -> Mapping[tuple[str, str], tuple[float, float]]:
    """Run the trials of the calibration, and return what recursive least squares estimates."""
    made = setups(values)
    conditions, cubes = zip(*TRIALS, strict=True)
    results = pool.map(rls_averages, conditions, cubes, [made[trial] for trial in TRIALS])
    return dict(zip(TRIALS, results, strict=True))


def calibrate(start: Vector, pool: Executor) -> Vector:
    """Fit the eight unknowns of the simulated rig to the paper's Table I, and return them.

    The docstring of `setups` lists the unknowns. They are fitted such that recursive least squares
    (RLS) estimates the same averages of b and k in the simulated trials as in the paper. The fit is
    a nonlinear least-squares fit.
    """

    def residuals(logarithms: Vector) -> Vector:
        out = []
        for trial, (b, k) in averages(start * np.exp(logarithms), pool).items():
            paper = table1()[*trial, "rls"]
            out += [(k / paper.k - 1.0) / K_TOLERANCE, np.log(max(b / paper.b, 0.05)) / B_TOLERANCE]
        return np.array(out)

    def slopes(logarithms: Vector) -> Vector:
        """Return the Jacobian of the residuals with respect to the logarithms of the unknowns.

        The derivatives are difference quotients. k1 and k3 of a cube affect only the residuals of
        the trials on this cube. Therefore, k1 is changed on all three cubes at the same time, and
        so is k3. The residuals are then evaluated five times: without a change, and with a change
        of k1, of k3, of the lag, and of the lost motion.
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

    A developer copies these values to the file `sim_backend/paper_rig.py`. The averages of b and k
    from recursive least squares are also printed, for the simulated rig and for the paper.
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
