"""Time until the wanted precision of k and b: signals of `autonomous`, compared with the sine.

    python benchmarks/excitation.py

Each trial ends by `--until`, or at its time limit. The wanted interval of b is the one that the
sine of 2 Hz (the excitation in the paper) reaches after `REFERENCE` s, in the median of `REHEARSED`
trials with other seeds; that of k is `K`. All signals have the limits that the simulated rig has
for this sine. Lag, lost motion and compliance of the transmission are those of a new calibration
in each trial, with errors drawn from its intervals: with one calibration, its error would be
common to all trials, and the coverage would be that of this one error.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from estimation.estimator import LEVEL_95
from sim_backend import FORCE_LAG, TRANSMISSION, Setup, paper_setup
from teleop.control.excitation_signals import AnySignal, Chirp, Designed, Multisine, Sine
from teleop.control.wanted_precision import WantedPrecision
from teleop.settings import trial_settings
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

CUBES = ("soft", "medium", "hard")
KINDS = {"stiffening": 1.0, "linear": 1.0, "viscous": 5.0}
"""Kinds of bodies, and the factor of the damping. A linear body has the secant stiffness of the
cube at the palpation depth."""
SIGNALS: dict[str, AnySignal] = {
    "sine": Sine(2.0),
    "chirp": Chirp(1.0, 4.0),
    "multisine": Multisine((1.0, 2.0, 3.0, 4.0)),
    "designed": Designed(4.0),
}
LIMIT = 15.0
"""Time limit of a trial [s]."""
REFERENCE, REHEARSED = 6.0, 5
"""Time after which the sine has the wanted precision [s], and number of trials for it."""
REHEARSAL_SEED, SEED = 424_200, 431_000
K = 0.02
"""Wanted half width of k."""


@dataclass
class Row:
    """Result of one trial."""

    time: float
    reached: bool
    covers: dict[str, bool]
    limited: bool


def body(cube: str, kind: str) -> Setup:
    """Return the simulated rig with a body."""
    setup = paper_setup("injector", cube)
    tissue = replace(setup.cube, b=KINDS[kind] * setup.cube.b)
    if kind != "stiffening":
        tissue = replace(tissue, k1=setup.force(setup.depth) / setup.depth, k3=0.0)
    return replace(setup, cube=tissue)


@contextmanager
def calibrated(seed: int) -> Iterator[None]:
    """Within the `with` block, the calibration of the simulated rig has errors of its size."""
    original = trial_settings.simulated_transmission
    known = original()
    draw = np.random.default_rng(seed).standard_normal(4) / LEVEL_95
    correlation = known.lag_lost_motion_correlation
    of_play = correlation * draw[0] + math.sqrt(1.0 - correlation**2) * draw[1]
    new = replace(
        known,
        force_lag=FORCE_LAG + known.force_lag_error * draw[0],
        lost_motion=TRANSMISSION.lost_motion + known.lost_motion_error * of_play,
        compliance=TRANSMISSION.compliance + known.compliance_error * draw[2],
    )
    trial_settings.simulated_transmission = lambda: new
    try:
        yield
    finally:
        trial_settings.simulated_transmission = original


def settings_of(cube: str, kind: str, seed: int, signal: AnySignal) -> TrialSettings:
    """Return the settings of a trial, with the limits for the sine."""
    base = TrialSettings(
        condition="autonomous",
        cube=cube,
        custom_setup=body(cube, kind),
        clock="virtual",
        seed=seed,
        duration=LIMIT,
        estimators=("rls",),
    )
    return replace(base, signal=signal, custom_limits=base.limits)


def wanted_of(cube: str, kind: str) -> float:
    """Return the half width of b that the sine reaches after `REFERENCE` s."""
    halves = []
    for seed in range(REHEARSAL_SEED, REHEARSAL_SEED + REHEARSED):
        with calibrated(seed):
            settings = settings_of(cube, kind, seed, SIGNALS["sine"])
            # the last 0.5 s are the ramp to zero, which the evaluation leaves out
            trial = run_trial(replace(settings, duration=REFERENCE + 0.5))
            result = trial.result.summary["result"]
        halves.append(0.5 * (result["b_high"] - result["b_low"]) / abs(result["b"]))
    return float(np.median(halves))


def row_of(settings: TrialSettings, seed: int) -> Row:
    """Run a trial until its end."""
    with calibrated(seed):
        trial = run_trial(settings)
        result, true = trial.result.summary["result"], trial.result.true
    assert trial.fault is None, trial.stop_text
    assert trial.precision
    covers = {}
    for part in ("k", "b"):
        if result[part] is not None and true:
            covers[part] = result[f"{part}_low"] <= true[part] <= result[f"{part}_high"]
    end = next(e["time"] for e in trial.ticks.events if e["mode"] == "stopping")
    return Row(end, trial.precision["reached"], covers, any(trial.statistics.limited.values()))


def text(name: str, signal: str, wanted: str, rows: list[Row], reference: float) -> str:
    """Return a line of the table."""
    times = [row.time if row.reached else math.inf for row in rows]
    median = float(np.median(times))
    covered = {
        part: [row.covers[part] for row in rows if part in row.covers] for part in ("k", "b")
    }
    shares = "".join(
        f"{np.mean(found):8.0%}" if found else f"{'-':>8}" for found in covered.values()
    )
    ratio = f"{median / reference:8.2f}" if math.isfinite(median) else f"{'-':>8}"
    shown = f"{median:8.1f}" if math.isfinite(median) else f"{f'>{LIMIT:g}':>8}"
    late = max(row.time for row in rows)
    return (
        f"{name:20}{signal:11}{wanted:>8}{shown}{late:8.1f}{ratio}"
        f"{sum(row.reached for row in rows):5}/{len(rows)}{shares}"
        f"{sum(row.limited for row in rows):8}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=SEED)
    parser.add_argument("--signals", default=",".join(SIGNALS))
    given = parser.parse_args()
    signals = given.signals.split(",")
    print(f"# python {' '.join(sys.argv)}, {date.today()}")
    print(
        f"# {given.seeds} trials a line; median and longest time [s]; coverage of the true values"
    )
    print(f"{'body':20}{'signal':11}{'b ±':>8}{'median':>8}{'longest':>8}{'ratio':>8}"
          f"{'reached':>8}{'k':>8}{'b':>8}{'limited':>8}")  # fmt: skip
    every: dict[str, list[Row]] = {signal: [] for signal in signals}
    ratios: dict[str, list[float]] = {signal: [] for signal in signals}
    for cube in CUBES:
        for kind in KINDS:
            half = wanted_of(cube, kind)
            reference = math.nan
            for signal in signals:
                rows = []
                for seed in range(given.first_seed, given.first_seed + given.seeds):
                    settings = settings_of(cube, kind, seed, SIGNALS[signal])
                    rows.append(row_of(replace(settings, until=WantedPrecision(K, half)), seed))
                times = [row.time if row.reached else LIMIT for row in rows]
                if signal == "sine":
                    reference = float(np.median(times))
                every[signal] += rows
                ratios[signal].append(float(np.median(times)) / reference)
                print(text(f"{cube}, {kind}", signal, f"{half:.2%}", rows, reference), flush=True)
    reference = float(np.median([row.time for row in every[signals[0]]]))
    for signal, rows in every.items():
        print(text("all", signal, "", rows, reference))
    for signal, found in ratios.items():
        print(f"ratio of the medians, {signal}: median over the bodies {np.median(found):.2f}, "
              f"largest {max(found):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
