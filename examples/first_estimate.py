"""
A first estimate: position and force in, stiffness and damping out
==================================================================

:func:`estimation.identify` filters position and force, and runs estimators. The settings of the
estimators are scaled from the data, so that nothing has to be tuned. The result contains the
estimates after every sample with their standard deviations, as arrays and as a data frame.
"""

# %%
# The recording
# -------------
# A simulated body with k = 2100 N/m and b = 15 N s/m is palpated for five seconds, sampled at
# 1 kHz. The encoder has a resolution of 1 um, and the force sensor has noise of 0.2 N.
import matplotlib.pyplot as plt
import numpy as np

from estimation import identify

rng = np.random.default_rng(0)
dt = 1e-3  # [s]
t = np.arange(0.0, 5.0, dt)
depth = 5e-3 - 3e-3 * np.cos(2 * np.pi * t) + 1e-3 * np.sin(2 * np.pi * 2.6 * t)  # [m]
position = np.round(depth, 6)  # [m]
force = 2100.0 * depth + 15.0 * np.gradient(depth, dt) + rng.normal(0.0, 0.2, t.size)  # [N]

# %%
# The estimates
# -------------
# The inputs are arrays in SI units. The last estimate of each estimator, with its 95 % interval:
found = identify(position, force, dt, ["rls", "me"])
for name, e in found.estimates.items():
    print(
        f"{name}: k = {e.k[-1]:.0f} ± {1.96 * e.k_std[-1]:.0f} N/m, "
        f"b = {e.b[-1]:.1f} ± {1.96 * e.b_std[-1]:.1f} N s/m (95 %)"
    )

# %%
# The same estimates as a data frame with one row for each sample, averaged over the last second:
frame = found.to_dataframe()
print(frame.loc[4.0:, ["rls_k", "rls_k_std", "rls_b", "rls_b_std"]].mean().round(2).to_string())

# %%
# As a figure
# -----------
# The shaded bands are the 95 % intervals, and the dashed lines are the true values.
# ``found.plot()`` draws a similar figure in one call.
figure, panels = plt.subplots(2, 1, figsize=(8.0, 5.0), sharex=True, layout="constrained")
for axes, parameter, truth, limits, unit in (
    (panels[0], "k", 2100.0, (2000.0, 2200.0), "N/m"),
    (panels[1], "b", 15.0, (0.0, 30.0), "N s/m"),
):
    for name in found.estimates:
        value, std = frame[f"{name}_{parameter}"], frame[f"{name}_{parameter}_std"]
        (line,) = axes.plot(t, value, linewidth=1.2, label=name)
        low, high = value - 1.96 * std, value + 1.96 * std
        axes.fill_between(t, low, high, color=line.get_color(), alpha=0.2, lw=0)
    axes.axhline(truth, color="black", linewidth=0.8, linestyle="--", label="truth")
    axes.set(ylabel=f"{parameter} [{unit}]", ylim=limits, xlim=(0.0, 5.0))
panels[0].legend(ncols=3, frameon=False)
panels[1].set_xlabel("time [s]")
plt.show()
