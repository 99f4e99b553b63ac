"""Calibrate the simulated rig against part of Table I: `python -m teleop.studies.paper.calibrate`.

Used are b and k of the RLS rows under the conditions free and autonomous, four numbers a
cube, for three unknowns a cube: k1, k3 and the lag of the force channel. All other cells of
Table I are predictions.

Depths are fixed beforehand, since Table I tells only k3 times the depth squared: 13, 7.5 and
2.6 mm of a block of 40 mm under `free`, and less under `autonomous`, as the paper says, but
deep enough for adaptive identification with the paper's gains to rise as fast as the paper's
Figure 5 shows; for the same reason the autonomous sine has 2 Hz. So the rise time of `ai` is no
independent prediction. Under `mimic` nothing is known of depth: it is that of `free`.
The true damping is an assumption of a few N s/m, rising with stiffness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from estimation import Bank, RecursiveLeastSquares, paper_preset
from sim_backend import CUBES, DEPTH, FORCE_LAG, Cube, Setup
from teleop.studies.paper.table1 import CALIBRATED, table1
from teleop.studies.paper.trials import paper_trial
from teleop.studies.workers import workers
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

K_TOLERANCE = 0.02
"""Error of k, as a share of it, that weighs as much as ..."""
B_TOLERANCE = 0.2
"""... this error of b, as a share of it."""


class RlsOnly(TrialSettings):
    """A trial whose bank holds RLS alone, for speed."""

    def make_bank(self) -> Bank:
        """A fresh bank with RLS alone."""
        preset = paper_preset(self.cube)
        return Bank(
            {
                "rls": RecursiveLeastSquares(
                    preset.forgetting, preset.initial_covariance, preset.sample_period
                )
            }
        )


def rls_averages(condition: str, cube: str, setup: Setup) -> tuple[float, float]:
    """Average (b, k) of RLS over a trial of the paper with another set-up."""
    settings = RlsOnly(**vars(replace(paper_trial(condition, cube), custom_setup=setup)))
    columns = run_trial(settings).columns
    return float(columns["rls_b"].mean()), float(columns["rls_k"].mean())


def calibrate(cube: str) -> tuple[Cube, float]:
    """The cube and the lag [s] whose RLS averages are nearest to the paper's."""
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
    """Print the values for `sim_backend/paper_rig.py`, and how near they come."""
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
