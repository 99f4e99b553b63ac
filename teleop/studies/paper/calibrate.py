"""Calibrate the simulated rig against part of Table I: `python -m teleop.studies.paper.calibrate`.

Used are b and k of the RLS rows under the conditions free and autonomous, twelve numbers, for
eight unknowns: k1 and k3 of each cube, one lag of the force channel, and one lost motion of the
slave. All other cells of Table I are predictions. The following are assumptions.

- Depths, since Table I tells only k3 times the depth squared. Under `autonomous` they are smaller,
  as the paper says, but deep enough for adaptive identification with the paper's gains to rise in
  the paper's 0.6 s; for the same reason the autonomous sine has 2 Hz. So the rise time of `ai` is
  no independent prediction. Under `mimic` they are those of `free`, since nothing is known of
  them. Force errors grow with depth, and the depths were chosen, by trial, such that the force
  errors have about the size of the paper's; so these are no independent prediction, either.
- The operator's tremor, given in `sim_backend/operators.py`, was chosen for the same reason: in the
  paper the force errors on the soft and the medium cube are larger under `free` and `mimic` than
  under `autonomous`.
- The compliance of the transmission is 7 um/N, as of a cable or a belt drive. It is the stiffness
  in series with the cube that keeps the hard cube within the grid of the multi-estimator, and it
  sets the friction that goes with the lost motion, some 17 N.
- True damping is a loss time of 1.5 ms times k1, that is a loss factor of 0.02 at 2 Hz, as of
  silicone rubber with little damping. To first order it cannot be told from the lag.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sim_backend import CUBES, DEPTH, FORCE_LAG, LOSS_TIME, TRANSMISSION, Cube, Setup
from teleop.studies.paper.table1 import CALIBRATED, table1
from teleop.studies.paper.trials import paper_trial
from teleop.studies.workers import workers
from teleop.trial.run import run_trial

K_TOLERANCE = 0.02
"""Error of k, as a share of it, that weighs as much as ..."""
B_TOLERANCE = 0.3
"""... this error of the logarithm of b."""
STEP = 0.03
"""Step of difference quotients, as a share of the value."""
EVALUATIONS = 5
"""Most evaluations of the residuals."""
Vector = NDArray[np.float64]

TRIALS = [(condition, cube) for cube in CUBES for condition in CALIBRATED]


def rls_averages(condition: str, cube: str, setup: Setup) -> tuple[float, float]:
    """Return the averages of RLS's b [N s/m] and k [N/m] over a trial of the paper.

    Parameters
    ----------
    condition, cube
        Names of condition and cube.
    setup
        Body, force channel and depth that replace those of the paper.
    """
    settings = replace(paper_trial(condition, cube), custom_setup=setup, estimators=("rls",))
    columns = run_trial(settings).columns
    return float(columns["rls_b"].mean()), float(columns["rls_k"].mean())


def setups(values: Vector) -> dict[tuple[str, str], Setup]:
    """Set-up of each trial from k1 of the cubes, k3 of the cubes, lag, and lost motion."""
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
    """Average (b, k) of RLS in each trial."""
    made = setups(values)
    conditions, cubes = zip(*TRIALS, strict=True)
    results = pool.map(rls_averages, conditions, cubes, [made[trial] for trial in TRIALS])
    return dict(zip(TRIALS, results, strict=True))


def calibrate(start: Vector, pool: Executor) -> Vector:
    """The values, as `setups` takes them, whose RLS averages are nearest to the paper's."""

    def residuals(logarithms: Vector) -> Vector:
        out = []
        for trial, (b, k) in averages(start * np.exp(logarithms), pool).items():
            paper = table1()[*trial, "rls"]
            out += [(k / paper.k - 1.0) / K_TOLERANCE, np.log(max(b / paper.b, 0.05)) / B_TOLERANCE]
        return np.array(out)

    def slopes(logarithms: Vector) -> Vector:
        """Jacobian in four evaluations: a trial depends on k1 and k3 of its own cube alone."""
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
    """Print the values for `sim_backend/paper_rig.py`, and how near they come."""
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
