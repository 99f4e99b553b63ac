"""Coverage of the published k and b on the default rig: `python benchmarks/published_results.py`.

The nine trials of the paper (three cubes, three conditions) run on the simulated rig with its lost
motion, lag and compliance. Each is evaluated as `teleop estimate` does:

- calibrated: with the transmission that `teleop lag` measures on a spring, anew for each seed. With
  one calibration for all trials, its error is the same in all of them, and nothing can be said on
  how often an interval that contains it is right;
- lag only: with the lag of the force, so that the lost motion must be found in the record;
- nothing: without any calibration.

Printed is in how many trials lost motion is found, and k and b are given, and how often their 95 %
intervals contain the true value: the tangent stiffness of the cube in series with the transmission
and at the tip, at the position at which k is reported, and the damping in series. The root mean
square of the error divided by the half width is 0.51 for an interval of a normal distribution that
contains the truth in 95 % of all cases.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from dataclasses import replace
from itertools import product
from typing import get_args

import numpy as np

from estimation.transmission import RIGID, TransmissionCalibration
from sim_backend import CUBES
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.recorded import recorded_settings, recorded_signals
from teleop.names import ConditionName
from teleop.rig.force_lag import SPRING, measure_simulated_lag
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import averaged_part
from teleop.trial.run import run_trial


def result_of(trial, transmission: TransmissionCalibration):
    """Return the result of a trial, and the position at which k is reported [m]."""
    settings = replace(
        recorded_settings(trial.recording),
        averaged=averaged_part(trial.recording, trial.settings),
        transmission=transmission,
    )
    evaluation = evaluate(recorded_signals(trial.recording), settings)
    local = evaluation.analysis.local
    return evaluation.analysis.result, local.best.position if local else 0.0


def truths(settings: TrialSettings, position: float) -> dict[str, float]:
    """Return the true values at a position behind the lost motion."""
    law, c = settings.setup.cube.slow, settings.setup.transmission.compliance
    tip = law.compressed(position, c)
    k = law.stiffness(tip)
    # the plant neglects that the damping force stretches the transmission
    return {"k": k / (1.0 + c * k), "k at the tip": k, "b": law.b / (1.0 + c * k)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=52_000)
    options = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    worst: dict[tuple[str, str], float] = {}
    ratios: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        calibrated = measure_simulated_lag(seed)[0].calibration(SPRING)
        for cube, condition in product(CUBES, get_args(ConditionName)):
            settings = TrialSettings(cube=cube, condition=condition, clock="virtual", seed=seed)
            trial = run_trial(settings)
            lag = TransmissionCalibration(
                calibrated.force_lag, force_lag_error=calibrated.force_lag_error
            )
            for name, known in (("calibrated", calibrated), ("lag only", lag), ("nothing", RIGID)):
                result, position = result_of(trial, known)
                counts[name, "trials"] += 1
                counts[name, "lost motion"] += result.lost_motion is not None
                found = {
                    symbol: (*result.interval(symbol), getattr(result, symbol))
                    for symbol in ("k", "b")
                    if result.determines(symbol)
                }
                if result.k_tip:
                    tip = result.k_tip
                    found["k at the tip"] = (tip.low, tip.high, tip.value)
                true = truths(settings, position)
                for symbol, (low, high, value) in found.items():
                    counts[name, symbol] += 1
                    counts[name, f"{symbol} inside"] += low <= true[symbol] <= high
                    error = abs(value / true[symbol] - 1.0)
                    half = 0.5 * (high - low)
                    ratios[name, symbol].append((value - true[symbol]) / half)
                    worst[name, symbol] = max(worst.get((name, symbol), 0.0), error)
        print(f"seed {seed}: done", flush=True)
    print(f"{counts['nothing', 'trials']} trials, seeds from {options.first_seed}")
    for name in ("calibrated", "lag only", "nothing"):
        print(f"{name}: lost motion found in the record of {counts[name, 'lost motion']} trials")
        for symbol in ("k", "k at the tip", "b"):
            if given := counts[name, symbol]:
                print(
                    f"  {symbol:13} given in {given}; the interval contains the true value in "
                    f"{counts[name, f'{symbol} inside'] / given:.1%}; largest error "
                    f"{worst[name, symbol]:.1%}; rms of error / half width "
                    f"{np.sqrt(np.mean(np.square(ratios[name, symbol]))):.2f}"
                )


if __name__ == "__main__":
    main()
