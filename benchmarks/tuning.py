"""Show the effect of each constant of `estimation/tuning.py`, and of multiples of the constants.

    python benchmarks/tuning.py HYSTERESIS DWELL     # only these constants

For each value of a constant, two or three numbers are printed. The first is the longest time until
k stays within 5 % after a change of the cube from 2000 to 20 000 N/m or back, over several phases
of a motion of 3 Hz. The second is the standard deviation of k due to noise in one second without a
change of the cube. For a multi-estimator, the third is the number of changes of k in this second.
The allowed time is 0.3 s, as in `benchmarks/swap.py`.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from bank_case import (
    DEPTH,
    EXPONENT,
    NOISE,
    RATE,
    B,
    bank_of,
    hunt_crossley,
    hunt_crossley_force,
    show,
)

from estimation import tuning

METHODS_OF = {
    "CONDITIONAL_FORGETTING": ("rls_conditional",),
    "CONDITIONAL_THRESHOLD": ("rls_conditional",),
    "TRACE": ("rls_trace",),
    "PASSIVE_FORGETTING": ("passive",),
    "WINDOW": ("window",),
    "OBSERVER_MEMORY": ("observer",),
    "NORMALISED_RATE": ("ai_normalised",),
    "INDIRECT_RATE": ("indirect",),
    "REFERENCE_RATE": ("reference",),
    "REFERENCE_BANDWIDTH": ("reference",),
    "COMPOSITE_FORGETTING": ("composite",),
    "COMPOSITE_BANDWIDTH": ("composite",),
    "SPECTRAL_MOTION": ("spectral",),
    "CONTACT_FORCE": ("hc_double", "hc_log"),
    "LOGARITHMIC_MEMORY": ("hc_log",),
    "SWITCHING_FORGETTING": ("me_switching",),
    "HYSTERESIS": ("me_switching",),
    "DWELL": ("me_switching",),
    "MOVING_FORGETTING": ("me_moving",),
    "PATIENCE": ("me_moving",),
    "FIRST_SPACING_B": ("me_moving",),
    "FIRST_SPACING_K": ("me_moving",),
}
FACTORS = (0.1, 0.5, 0.8, 1.0, 1.25, 2.0, 10.0)
PHASES = 8
LASTING = 2.0
"""Duration of each of the three phases soft, hard and soft [s]."""
SOFT, HARD = 2000.0, 20_000.0
FREQUENCY = 3.0


def case(name: str, phase: float) -> tuple[float, float, float]:
    """Return the settling time, the relative standard deviation and the changes of k.

    The settling time is in seconds. The standard deviation and the number of changes are computed
    over the last second of the first cube.
    """
    t = np.arange(round(3 * LASTING * RATE)) / RATE
    omega = 2.0 * math.pi * FREQUENCY
    x = DEPTH + 3e-3 * np.sin(omega * t + phase)
    v = 3e-3 * omega * np.cos(omega * t + phase)
    k = np.where((t >= LASTING) & (t < 2 * LASTING), HARD, SOFT)
    force = B * v + k * x
    if hunt_crossley(name):
        force = hunt_crossley_force(x, v, B, k)
        k = k * (x / DEPTH) ** (EXPONENT - 1.0)
    noise = np.random.default_rng(0).normal(0.0, NOISE, len(t))
    found = bank_of([name], gated=True).run(x, v, force + noise, 1.0 / RATE)[name].k / k
    parts = np.split(np.abs(found - 1.0) > 0.05, 3)[1:]
    ends = [np.flatnonzero(part)[-1] + 1 if part.any() else 0 for part in parts]
    settled = np.split(found, 3)[0][-round(RATE) :]
    seconds = max(n / RATE if n < len(parts[0]) else math.inf for n in ends)
    return seconds, float(np.std(settled)), np.count_nonzero(np.diff(settled))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("constants", nargs="*", metavar="CONSTANT", help="default: all")
    wanted = parser.parse_args().constants or METHODS_OF
    rows = []
    for constant, name in ((c, name) for c in wanted for name in METHODS_OF[c]):
        chosen = getattr(tuning, constant)
        cells = []
        for factor in FACTORS:
            setattr(tuning, constant, factor * chosen)
            try:
                cases = [case(name, 2.0 * math.pi * n / PHASES) for n in range(PHASES)]
                seconds, deviation, changes = np.max(cases, axis=0)
                cell = f"{seconds:.2f} s, {100.0 * deviation:.2f} %"
                cells.append(f"{cell}, {changes:.0f}" if name.startswith("me_") else cell)
            except ValueError:
                cells.append("refused")
        setattr(tuning, constant, chosen)
        rows.append((constant, name, f"{chosen:g}", *cells))
    show(
        "Worst time to within 5 % of k after a swap, deviation of k from noise, changes in 1 s",
        rows,
        ("constant", "method", "value", *(f"times {factor:g}" for factor in FACTORS)),
    )


if __name__ == "__main__":
    main()
