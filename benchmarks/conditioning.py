"""Measure the parameter errors with each conditioning: `python benchmarks/conditioning.py`.

The motions are those of the nine trials of the paper. The force of the cubes is b v + k x, so that
the true b and k are known exactly. The signals have the quantisation of the encoder and the noise
of the force sensor, but no lag. RLS has the paper's settings. Each number is the root mean square
over the nine trials.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.table import Table

from drivers import Command
from estimation import (
    Conditioner,
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    RecursiveLeastSquares,
    StateVariableFilter,
)
from sim_backend import CUBES, Cube, Plant, PlantParameters, Sensors
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

CONDITIONERS: dict[str, Conditioner] = {
    "filtered difference, 20 Hz": FilteredDifference(20.0),
    "filtered difference, 50 Hz": FilteredDifference(50.0),
    "FOAW, one count": FirstOrderAdaptiveWindowing(1e-6),
    "state-variable filter, 20 Hz": StateVariableFilter(20.0),
    "state-variable filter, 50 Hz": StateVariableFilter(50.0),
    "matched, 10 Hz": MatchedFilter(10.0),
    "matched, 20 Hz": MatchedFilter(20.0),
    "matched, 50 Hz": MatchedFilter(50.0),
}
SETTLED = slice(1500, 9400)
"""Samples after the start and before the final ramp of the autonomous condition."""


def signals(condition: str, cube: str) -> tuple[Cube, np.ndarray, np.ndarray, np.ndarray]:
    """Return a cube with k3 = 0, and position, true velocity and force in the motion of a trial."""
    trial = run_trial(TrialSettings(condition=condition, cube=cube, clock="virtual"))
    linear = replace(CUBES[cube], k3=0.0)
    plant = Plant(linear, PlantParameters(contact_force_lag=1e-6))
    rows = []
    for velocity in trial.columns["applied_slave_velocity"]:
        rows.append((plant.slave.x, plant.slave.v, plant.slave.force))
        plant.advance(1e-3, Command(0.0, velocity))
    x, v, f = np.array(rows).T
    count = Sensors().encoder_resolution
    noise = np.random.default_rng(1).normal(0.0, Sensors().force_noise, len(f))
    return linear, np.round(x / count) * count, v, f + noise


def main() -> None:
    errors: dict[str, list[tuple[float, float, float]]] = {name: [] for name in CONDITIONERS}
    for condition in ("free", "mimic", "autonomous"):
        for name in CUBES:
            cube, x, v_true, f = signals(condition, name)
            for label, conditioner in CONDITIONERS.items():
                conditioner.reset()
                xc, v, fc, *_ = conditioner.run(x, f, 1e-3)
                b, k, *_ = RecursiveLeastSquares(0.98, (100.0, 100.0)).run(xc, v, fc, 1e-3)
                errors[label].append(
                    (
                        float(np.std(v - v_true) / np.std(v_true)),
                        float(np.sqrt(np.mean((b[SETTLED] / cube.b - 1.0) ** 2))),
                        float(np.sqrt(np.mean((k[SETTLED] / cube.k1 - 1.0) ** 2))),
                    )
                )
    table = Table(title="RLS on linear cubes, relative errors", title_justify="left")
    for heading in ("conditioning", "velocity", "damping b", "stiffness k"):
        table.add_column(heading, justify="left" if heading == "conditioning" else "right")
    for label, rows in errors.items():
        velocity, b, k = np.sqrt(np.mean(np.square(rows), axis=0))
        table.add_row(label, f"{velocity:.1%}", f"{b:.1%}", f"{k:.3%}")
    Console().print(table)


if __name__ == "__main__":
    main()
