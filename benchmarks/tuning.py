"""Show the effect of the tuning constants in `estimation/methods`, and of multiples of them.

    python benchmarks/tuning.py HYSTERESIS FORGETTING    # only the constants of this name

The paper gives no values for these constants: they belong to the methods that this package adds.
For each value of a constant, two or three numbers are printed. The first is the settling time: the
longest time until k stays within 5 % after a change of the cube from 2000 to 20 000 N/m or back,
over several phases of a motion of 3 Hz. The second is the standard deviation of k due to noise in
one second without a change of the cube. For a multi-estimator, the third is the number of changes
of k in this second. The allowed time is 0.3 s, as in `benchmarks/swap.py`.

The constants for forgetting factors and forgetting rates are multiples of 0.25. Among the multiples
with a settling time of at most 0.3 s, the one with the smallest standard deviation of k is chosen.
"""

from __future__ import annotations

import argparse
import math
import sys

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

CONSTANTS = {
    "rls_conditional": ("FORGETTING", "THRESHOLD"),
    "rls_trace": ("TRACE",),
    "passive": ("FORGETTING",),
    "window": ("WINDOW",),
    "observer": ("DISTURBANCE_MEMORY",),
    "ai_normalised": ("RATE",),
    "indirect": ("RATE",),
    "reference": ("RATE", "BANDWIDTH"),
    "composite": ("FORGETTING", "BANDWIDTH"),
    "spectral": ("MOTION",),
    "hc_double": ("CONTACT_FORCE",),
    "hc_log": ("CONTACT_FORCE", "MEMORY"),
    "me_switching": ("FORGETTING", "HYSTERESIS", "DWELL"),
    "me_moving": ("FORGETTING", "PATIENCE", "FIRST_SPACING_B", "FIRST_SPACING_K"),
}
"""Names of the constants in the module of each method."""
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
    wanted = parser.parse_args().constants
    rows = []
    pairs = [(name, constant) for name, constants in CONSTANTS.items() for constant in constants]
    for name, constant in pairs:
        if wanted and constant not in wanted:
            continue
        module = sys.modules[type(bank_of([name])[name]).__module__]
        chosen = getattr(module, constant)
        cells = []
        for factor in FACTORS:
            setattr(module, constant, factor * chosen)
            try:
                cases = [case(name, 2.0 * math.pi * n / PHASES) for n in range(PHASES)]
                seconds, deviation, changes = np.max(cases, axis=0)
                cell = f"{seconds:.2f} s, {100.0 * deviation:.2f} %"
                cells.append(f"{cell}, {changes:.0f}" if name.startswith("me_") else cell)
            except ValueError:
                cells.append("refused")
        setattr(module, constant, chosen)
        rows.append((constant, name, f"{chosen:g}", *cells))
    show(
        "Worst time to within 5 % of k after a swap, deviation of k from noise, changes in 1 s",
        rows,
        ("constant", "method", "value", *(f"times {factor:g}" for factor in FACTORS)),
    )


if __name__ == "__main__":
    main()
