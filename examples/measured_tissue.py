"""Measured tissue: one damping for each frequency, none for all of them.

A testing machine indented a preloaded soft specimen at 0.2, 0.5 and 1 Hz. Each recording alone
fits f = b v + k x; all together do not: between their segments b spreads far beyond noise, and
`PooledSegments.misfit` tells. Damping falls about as 1/f, the loss a cycle hardly changes, and a
body that relaxes, the standard linear solid, comes closer than any other model here.

    python examples/measured_tissue.py [folder for the figure] [folder of the measured files]
"""

# %%
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import estimation
from estimation import MODELS, MatchedFilter, PooledSegments, identify

ARGUMENTS = [] if "ipykernel" in sys.modules else sys.argv[1:]  # those of a notebook are its own
FOLDER = Path(*ARGUMENTS[:1])
SHARED = Path(estimation.__file__).parents[2] / "shared" / "data" / "mach1"  # beside the checkout
DATA = Path(*ARGUMENTS[1:2] or [SHARED])
MM, GF = 1e-3, 9.80665e-3  # [m], [N]
DT, BANDWIDTH = 0.01, 5.0  # [s], [Hz]


def measured(frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement [m] and force [N] about the preload, less a second of rest at either end."""
    path = DATA / f"sinusoid_{frequency:g}Hz.csv"
    _, position, force = np.loadtxt(path, delimiter=",", skiprows=1).T[:, 100:-100]
    return (position - position.mean()) * MM, (force - force.mean()) * GF


# %% Each frequency alone, and its segments pooled with those of the others.
recordings = {frequency: measured(frequency) for frequency in (0.2, 0.5, 1.0)}
figure = Figure(figsize=(9.0, 4.0), layout="constrained")
loops, damping = figure.subplots(1, 2)
together = PooledSegments(2.0, MatchedFilter(BANDWIDTH).correlation(DT))
for frequency, (x, f) in recordings.items():
    alone = identify(x, f, DT, ["segments"], bandwidth=BANDWIDTH)
    (b, b_std), (k, k_std) = alone.bank["segments"].values.values()
    print(
        f"{frequency:g} Hz: k = {k / 1e3:.0f} ± {1.96 * k_std / 1e3:.0f} N/mm, "
        f"b = {b / 1e3:.1f} ± {1.96 * b_std / 1e3:.1f} N s/mm, "
        f"misfit: {alone.bank['segments'].misfit or 'none'}"
    )
    everything = together.run(*alone.regression[:4])
    loops.plot(x / MM, f, linewidth=0.8, label=f"{frequency:g} Hz")
    damping.errorbar(frequency, b / 1e3, 1.96 * b_std / 1e3, fmt="o", capsize=4)
print(f"together: {together.note(everything)}")

# %% Which model explains the three together: what least squares leaves of the force.
for name, model in MODELS.items():
    parts = [MatchedFilter(BANDWIDTH, model=model).run(x, f, DT) for x, f in recordings.values()]
    phi = np.vstack([np.column_stack((part.v, part.x, part.further)) for part in parts])
    phi /= np.sqrt(np.mean(phi**2, axis=0))
    f = np.concatenate([part.f for part in parts])
    left = f - phi @ np.linalg.lstsq(phi, f)[0]
    print(f"{name}: leaves {np.sqrt(np.mean(left**2)):.2f} N rms")

# %% The loops are as wide at every frequency, so b falls with it.
loops.set(xlabel="displacement [mm]", ylabel="force about the preload [N]")
loops.legend(frameon=False)
hertz = np.geomspace(0.15, 1.3, 50)
damping.plot(hertz, 0.5 * 23.2 / hertz, "k--", linewidth=0.8, label="1/f, through 0.5 Hz")
low, high = (everything.b[-1] + side * 1.96 * everything.b_std[-1] for side in (-1, 1))
damping.axhspan(max(low, 1e3) / 1e3, high / 1e3, alpha=0.15, label="all together, 95 %")
damping.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel="b [N s/mm]")
damping.legend(frameon=False)
figure.savefig(FOLDER / "measured_tissue.png", dpi=150)
