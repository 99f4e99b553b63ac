"""A swapped cube: soft becomes hard between two samples, and each estimator follows in its way.

Following fast and being quiet are at odds: what forgets within half a period of the motion is
there within one. An interval holds for parameters that stay as they are, so it is wrong in
between, and wakes up only as far as its estimator lets it: look at both, never at k alone.

    python examples/swapped_cube.py [folder for the figure]
"""

# %%
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from estimation import coverage, identify

ARGUMENTS = [] if "ipykernel" in sys.modules else sys.argv[1:]  # those of a notebook are its own
FOLDER = Path(*ARGUMENTS[:1])

# %% Palpation at 1 kHz; after five seconds the cube of 2100 N/m is one of 6000 N/m.
rng = np.random.default_rng(0)
dt, swap = 1e-3, 5.0  # [s]
t = np.arange(0.0, 10.0, dt)
x = 5e-3 - 3e-3 * np.cos(2 * np.pi * t) + 1e-3 * np.sin(2 * np.pi * 2.6 * t)  # [m]
truth = np.where(t < swap, 2100.0, 6000.0)  # [N/m]
force = 15.0 * np.gradient(x, dt) + truth * x + rng.normal(0.0, 0.05, t.size)  # [N]

# %% How long until the stiffness is within 5 % and stays, and how often the interval is right.
names = ("rls", "me", "ai", "kalman", "rls_trace")
found = identify(x, force, dt, names, bandwidth=20.0)
parts = {"before": (t > 2.0) & (t < swap), "after": t > swap + 2.0}
for name, e in found.estimates.items():
    off = (np.abs(e.k / truth - 1.0) > 0.05) & (t > swap)
    arrival = t[off][-1] - swap
    right = [f"{coverage(e.k[p], e.k_std[p], truth[p]):.0%} {when}" for when, p in parts.items()]
    print(
        f"{name:>9}: within 5 % after {arrival:.2f} s, ± {1.96 * e.k_std[-1]:.0f} N/m "
        f"in the end, right {' and '.join(right)}"
    )

# %%
figure = Figure(figsize=(9.0, 6.0), layout="constrained")
panels = figure.subplots(len(names), 1, sharex=True, sharey=True)
for axes, (name, e) in zip(panels, found.estimates.items(), strict=True):
    (line,) = axes.plot(t, e.k, label=name, linewidth=1.2)
    low, high = e.k - 1.96 * e.k_std, e.k + 1.96 * e.k_std
    axes.fill_between(t, low, high, color=line.get_color(), alpha=0.25, lw=0)
    axes.plot(t, truth, "k--", linewidth=0.8)
    axes.set(ylabel="k [N/m]", xlim=(4.0, 8.0), ylim=(1000.0, 8000.0))
    axes.legend(frameon=False, loc="lower right")
panels[-1].set_xlabel("time [s]")
figure.savefig(FOLDER / "swapped_cube.png", dpi=150)
