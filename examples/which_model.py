"""
Which model: compare the error of the force predicted one sample ahead
======================================================================

Five bodies are palpated with the same motion. Each body obeys a different model of ``MODELS``.
Recursive least squares estimates the parameters of each body with each model. With a short memory,
this method finds values of b and k for every body, so that the estimates do not show whether the
model is right. The error of the force that is predicted for the next sample shows this: the error
is as small as the noise only with the right model. If several models are equally good, use the
model with the fewest parameters.
"""

# %%
# Five bodies
# -----------
# The motion is the same for all bodies, sampled at 250 Hz. It is a sum of two sines, because with
# a single sine, stiffness and inertia cannot be estimated separately.
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from estimation import MODELS, identify, predicted_force
from estimation.filters import Lag

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

# %%
# Every body with every model
# ---------------------------
# The root mean square of the one-step error [mN] is computed without the first two seconds. With
# the model ``sls``, the error is larger than the noise, because one regressor of this model, the
# rate of change of the force, is computed from the noisy force.
errors = np.empty((len(bodies), len(MODELS)))
for row, (body, force) in enumerate(bodies.items()):
    for column, model in enumerate(MODELS):
        found = identify(x, force + noise, dt, ["rls"], model, bandwidth=20.0)
        error = found.regression.f - predicted_force(found.regression, found.estimates["rls"])
        errors[row, column] = 1e3 * np.sqrt(np.mean(error[500:] ** 2))
    smallest = np.argmax(errors[row] < 1.2 * errors[row].min())
    print(f"{body}: {errors[row, smallest]:.1f} mN with {[*MODELS][smallest]}")

# %%
# As a table in colour
# --------------------
figure, axes = plt.subplots(figsize=(7.0, 5.0), layout="constrained")
image = axes.imshow(errors, norm=LogNorm(), cmap="viridis_r")
for (row, column), error in np.ndenumerate(errors):
    colour = "white" if error > 50.0 else "black"
    axes.text(column, row, f"{error:.3g}", ha="center", va="center", color=colour)
axes.set_xticks(range(len(MODELS)), MODELS)
axes.set_yticks(range(len(bodies)), bodies)
axes.set(xlabel="model that is fitted", ylabel="body that is palpated")
figure.colorbar(image, label="one-step error, rms [mN]")
plt.show()
