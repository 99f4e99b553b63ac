"""
Measured tissue: the damping depends on the frequency
=====================================================

A testing machine indented a preloaded soft specimen at 0.2, 0.5 and 1 Hz. The model f = b v + k x
fits each recording alone. It does not fit all three recordings with the same b and k, because b is
approximately proportional to 1/frequency. ``PooledSegments.misfit`` reports this. Of the models
compared here, the standard linear solid, in which the force relaxes, has the smallest residual.
"""

# %%
# The data
# --------
# The arrays contain the displacement [m] and the force [N], each minus its mean under preload. The
# first and the last second, in which the machine rests, are omitted. The folder
# ``examples/data/mach1`` contains the source and the licence of the data.
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from estimation import MODELS, MatchedFilter, PooledSegments, identify

HERE = Path(globals().get("__file__", "measured_tissue.py")).resolve().parent
DATA = HERE / "data" / "mach1"
MM, GF = 1e-3, 9.80665e-3  # [m], [N]
DT, BANDWIDTH = 0.01, 5.0  # [s], [Hz]

recordings = {}
for frequency in (0.2, 0.5, 1.0):
    path = DATA / f"sinusoid_{frequency:g}Hz.csv"
    _, x, f = np.loadtxt(path, delimiter=",", skiprows=1).T[:, 100:-100]
    recordings[frequency] = (x - x.mean()) * MM, (f - f.mean()) * GF

# %%
# Each frequency alone, and all together
# --------------------------------------
# First, b and k are estimated from each recording alone. Then the segments of all recordings are
# pooled in one estimate.
figure, (loops, damping) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
pooled = PooledSegments(2.0, MatchedFilter(BANDWIDTH).correlation(DT))
for frequency, (x, f) in recordings.items():
    alone = identify(x, f, DT, ["segments"], bandwidth=BANDWIDTH)
    (b, b_std), (k, _) = alone.bank["segments"].values.values()
    misfit = alone.bank["segments"].misfit or "none"
    print(f"{frequency:g} Hz: k = {k:.0f} N/m, b = {b:.0f} N s/m, misfit: {misfit}")
    together = pooled.run(*alone.regression[:4])
    loops.plot(x / MM, f, linewidth=0.8, label=f"{frequency:g} Hz")
    damping.errorbar(frequency, b * MM, 1.96 * b_std * MM, fmt="o", label=f"{frequency:g} Hz")
print(f"together: {pooled.note(together)}")

b, std = together.b[-1] * MM, together.b_std[-1] * MM
damping.axhspan(b - 1.96 * std, b + 1.96 * std, color="0.9", label="together, 95 %")
hertz = np.linspace(0.15, 1.1, 100)
damping.plot(hertz, 11.6 / hertz, "k--", linewidth=0.8, label="1/f")
damping.set(xlabel="frequency [Hz]", ylabel="b [N s/mm]", xlim=(0.1, 1.1), ylim=(-15.0, 80.0))
damping.legend(frameon=False)
loops.set(xlabel="displacement [mm]", ylabel="force about the preload [N]")
loops.legend(frameon=False)
plt.show()

# %%
# The hysteresis loops are equally wide at every frequency: the energy that is dissipated in a cycle
# does not depend on the speed of the motion. A viscous damper would dissipate more energy at higher
# speed.

# %%
# Which model fits all three recordings best
# ------------------------------------------
# Each model is fitted to all three recordings together by least squares. The root mean square of
# the force residual is printed:
for name, model in MODELS.items():
    parts = [MatchedFilter(BANDWIDTH, model=model).run(x, f, DT) for x, f in recordings.values()]
    phi = np.vstack([np.column_stack((part.v, part.x, part.further)) for part in parts])
    phi /= np.sqrt(np.mean(phi**2, axis=0))
    f = np.concatenate([part.f for part in parts])
    residual = f - phi @ np.linalg.lstsq(phi, f)[0]
    print(f"{name}: residual {np.sqrt(np.mean(residual**2)):.2f} N rms")
