"""A first estimate: position and force in, stiffness with its interval out.

`identify` conditions the two signals and runs estimators with settings scaled from the data, so
nothing has to be tuned. Its result has every number after every sample, as a data frame and as a
figure, each with the standard deviation to trust it by.
"""

# %%
import sys
from pathlib import Path

import numpy as np

from estimation import identify

ARGUMENTS = [] if "ipykernel" in sys.modules else sys.argv[1:]  # [folder for the figure]
FOLDER = Path(*ARGUMENTS[:1])

# %% A recording: palpation of a body of 2100 N/m and 15 N s/m for five seconds, at 1 kHz.
rng = np.random.default_rng(0)
dt = 1e-3  # [s]
t = np.arange(0.0, 5.0, dt)
depth = 5e-3 - 3e-3 * np.cos(2 * np.pi * t) + 1e-3 * np.sin(2 * np.pi * 2.6 * t)  # [m]
position = np.round(depth, 6)  # by an encoder that counts microns
force = 2100.0 * depth + 15.0 * np.gradient(depth, dt) + rng.normal(0.0, 0.2, t.size)  # [N]

# %% Arrays in, estimates out.
found = identify(position, force, dt, ["rls", "me"])
for name, e in found.estimates.items():
    print(
        f"{name}: k = {e.k[-1]:.0f} ± {1.96 * e.k_std[-1]:.0f} N/m, "
        f"b = {e.b[-1]:.1f} ± {1.96 * e.b_std[-1]:.1f} N s/m (95 %)"
    )

# %% Everything as a data frame, a row for each sample.
frame = found.to_dataframe()
print(frame.loc[4.0:, ["rls_k", "rls_k_std", "rls_b", "rls_b_std"]].mean().round(2).to_string())

# %% And as a figure.
figure = found.plot()
for axes, truth in zip(figure.axes, (2100.0, 15.0), strict=True):
    axes.axhline(truth, color="black", linewidth=0.8, linestyle="--")
figure.savefig(FOLDER / "first_estimate.png", dpi=150)
