"""Which model: the error of a one-step prediction tells, the estimates alone do not.

The same motion palpates five bodies, one of each kind in `MODELS`, and recursive least squares
follows each with each model. Whatever forgets finds some b and k for anything, but the force
that it predicts for the next sample is down to the noise with the right model alone; where
several are, as all five on the simplest body, take the smallest.
"""

# %%
import sys
from pathlib import Path

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from estimation import MODELS, identify, predicted_force
from estimation.filters import Lag

ARGUMENTS = [] if "ipykernel" in sys.modules else sys.argv[1:]  # [folder for the figure]
FOLDER = Path(*ARGUMENTS[:1])

# %% Five bodies under the same motion, at 250 Hz. One sine could not tell k from inertia.
dt = 4e-3  # [s]
t = np.arange(0.0, 8.0, dt)
x = 6e-3 + 4e-3 * np.sin(2 * np.pi * 0.7 * t) + 1e-3 * np.sin(2 * np.pi * 2.3 * t)  # [m]
v = np.gradient(x, dt)
f = 15.0 * v + 2000.0 * x  # [N]
relaxation = Lag(0.05)  # f + tau f' = b v + k x
bodies = {
    "kelvin-voigt": f,
    "datum": f + 0.5,
    "inertia": f + 2.0 * np.gradient(v, dt),
    "stiffening": f + 3e6 * x**3,
    "sls": np.array([relaxation.update(value, dt) for value in f.tolist()]),
}
noise = np.random.default_rng(0).normal(0.0, 0.02, t.size)

# %% Each with each model: root mean square of the one-step error [mN], the start left out. That of
# sls stays above the noise, since one of its regressors, the rate of the force, is noisy itself.
errors = np.empty((len(bodies), len(MODELS)))
for row, (body, force) in enumerate(bodies.items()):
    for column, model in enumerate(MODELS):
        found = identify(x, force + noise, dt, ["rls"], model, bandwidth=20.0)
        error = found.regression.f - predicted_force(found.regression, found.estimates["rls"])
        errors[row, column] = 1e3 * np.sqrt(np.mean(error[500:] ** 2))
    smallest = np.argmax(errors[row] < 1.2 * errors[row].min())
    print(f"{body}: {errors[row, smallest]:.1f} mN with {[*MODELS][smallest]}")

# %%
figure = Figure(figsize=(7.0, 5.0), layout="constrained")
axes = figure.add_subplot()
image = axes.imshow(errors, norm=LogNorm(), cmap="viridis_r")
for (row, column), error in np.ndenumerate(errors):
    colour = "white" if error > 50.0 else "black"
    axes.text(column, row, f"{error:.3g}", ha="center", va="center", color=colour)
axes.set_xticks(range(len(MODELS)), MODELS)
axes.set_yticks(range(len(bodies)), bodies)
axes.set(xlabel="model that is fitted", ylabel="body that is palpated")
figure.colorbar(image, label="one-step error, rms [mN]")
figure.savefig(FOLDER / "which_model.png", dpi=150)
