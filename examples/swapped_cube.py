"""
A swapped cube: how each estimator follows a jump of the stiffness
==================================================================

The stiffness changes suddenly from one sample to the next. An estimator that follows a change fast
is also more sensitive to noise. Methods with the same memory differ in this compromise. A 95 %
interval is valid only for constant parameters. The interval is therefore valid before the jump and
after the estimate has converged, but not between these times.
"""

# %%
# The recording
# -------------
# The palpation is sampled at 500 Hz. After five seconds, the cube of 2100 N/m is replaced by a cube
# of 6000 N/m.
import matplotlib.pyplot as plt
import numpy as np

from estimation import coverage, identify

rng = np.random.default_rng(0)
dt, swap = 2e-3, 5.0  # [s]
t = np.arange(0.0, 10.0, dt)
x = 5e-3 - 3e-3 * np.cos(2 * np.pi * t) + 1e-3 * np.sin(2 * np.pi * 2.6 * t)  # [m]
truth = np.where(t < swap, 2100.0, 6000.0)  # [N/m]
force = truth * x + 15.0 * np.gradient(x, dt) + rng.normal(0.0, 0.1, t.size)  # [N]

# %%
# Six methods
# -----------
# For each method, two results are printed. The first is the time from the swap until the estimated
# stiffness stays within 5 % of the true value. The second is the share of samples whose 95 %
# interval contains the true value: before the swap, in the first second after the swap, and later.
names = ("rls", "me", "ai", "kalman", "rls_trace", "indirect")
found = identify(x, force, dt, names, bandwidth=20.0)
parts = {
    "before": (t > 2.0) & (t < swap),
    "just after": (t > swap) & (t < swap + 1.0),
    "later": t > swap + 2.0,
}
figure, panels = plt.subplots(
    2, 3, figsize=(9.0, 5.5), sharex=True, sharey=True, layout="constrained"
)
for axes, (name, e) in zip(panels.flat, found.estimates.items(), strict=True):
    arrival = t[(np.abs(e.k / truth - 1.0) > 0.05) & (t > swap)][-1] - swap
    right = [f"{coverage(e.k[p], e.k_std[p], truth[p]):.0%} {when}" for when, p in parts.items()]
    print(f"{name}: within 5 % after {arrival:.2f} s; interval right {', '.join(right)}")
    (line,) = axes.plot(t, e.k, linewidth=1.2)
    low, high = e.k - 1.96 * e.k_std, e.k + 1.96 * e.k_std
    axes.fill_between(t, low, high, color=line.get_color(), alpha=0.25, lw=0)
    axes.plot(t, truth, "k--", linewidth=0.8)
    axes.set(title=f"{name}, {arrival:.2f} s", xlim=(4.5, 7.5), ylim=(1000.0, 8000.0))
figure.suptitle("Stiffness with its 95 % interval, and the time until it is within 5 %")
figure.supxlabel("time [s]")
figure.supylabel("k [N/m]")
plt.show()
