"""Calibrate the simulated rig against part of Table I: `python -m teleop.studies.paper.calibrate`.

For each cube, three parameters are fitted: k1, k3 and the lag of the force channel. The data are b
and k of RLS under the conditions free and autonomous, four numbers per cube. All other cells of
Table I are predictions.

The depths are fixed before the fit, because Table I determines only k3 times the depth squared.
Under `free` they are 13, 7.5 and 2.6 mm for a block of 40 mm. Under `autonomous` they are smaller,
as in the paper, but large enough that adaptive identification with the paper's gains rises as
fast as in the paper's Figure 5. For the same reason the autonomous sine has 2 Hz. The rise time of
`ai` is therefore not an independent prediction. Under `mimic` the depth is unknown; that of `free`
is used. The true damping is assumed to be a few N s/m, and to increase with stiffness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from sim_backend import CUBES, DEPTH, FORCE_LAG, Cube, Setup
from teleop.studies.paper.table1 import CALIBRATED, table1
from teleop.studies.paper.trials import paper_trial
from teleop.studies.workers import workers
from teleop.trial.run import run_trial

K_TOLERANCE = 0.02
"""Tolerance of the relative error of k, which scales its residual in the fit."""
B_TOLERANCE = 0.2
"""Tolerance of the relative error of b, which scales its residual in the fit."""


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


def calibrate(cube: str) -> tuple[Cube, float]:
    """Return the cube and the lag [s] whose RLS averages best fit the paper's."""
    b_true = CUBES[cube].b
    start = np.array([CUBES[cube].k1, CUBES[cube].k3, FORCE_LAG[cube]])

    def residuals(shares: np.ndarray) -> list[float]:
        k1, k3, lag = shares * start
        out = []
        for condition in CALIBRATED:
            b, k = rls_averages(
                condition, cube, Setup(Cube(k1, k3, b_true), lag, DEPTH[condition][cube])
            )
            paper = table1()[condition, cube, "rls"]
            out += [(k / paper.k - 1.0) / K_TOLERANCE, (b / paper.b - 1.0) / B_TOLERANCE]
        return out

    fit = least_squares(residuals, np.ones(3), bounds=(0.05, 10.0), diff_step=0.02, xtol=1e-4)
    k1, k3, lag = fit.x * start
    return Cube(float(k1), float(k3), b_true), float(lag)


def main() -> None:
    """Print the values for `sim_backend/paper_rig.py`, and the averages beside the paper's."""
    with workers() as pool:
        fits = list(pool.map(calibrate, CUBES))
    for cube, (body, lag) in zip(CUBES, fits, strict=True):
        print(f"{cube}: Cube(k1={body.k1:.4g}, k3={body.k3:.3g}, b={body.b:g}), lag {lag:.3g} s")
        for condition in CALIBRATED:
            b, k = rls_averages(condition, cube, Setup(body, lag, DEPTH[condition][cube]))
            paper = table1()[condition, cube, "rls"]
            print(f"    {condition}: k {k:.0f} (paper {paper.k:.0f}), b {b:.1f} ({paper.b:.1f})")


if __name__ == "__main__":
    main()
