"""
A live loop: one sample in, one estimate out, and a gate
========================================================

The loop reads a sample from a rig, commands a velocity, filters the sample and updates a bank of
estimators. Without contact or without motion, a sample contains no information on the tissue. Then
the gate is closed: an estimator with a gate keeps its last estimate, and its flag ``held`` is true.
The paper's RLS has no gate. Without contact, its estimate is that of a body without stiffness.
"""

# %%
# The motion
# ----------
# The slave moves to and fro in the air, and then in contact. It rests in contact for two seconds,
# and moves to and fro in contact again. Finally, it moves to and fro in the air again.
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from drivers import Command
from estimation import MatchedFilter, paper_preset
from sim_backend import Cube, SimulatedRig
from teleop.control.clock import VirtualClock

t = np.arange(0.0, 12.0, 1e-3)
middle = np.interp(t, (1.5, 2.0, 9.5, 10.0), (-6e-3, 6e-3, 6e-3, -6e-3))
swing = np.interp(t, (5.0, 5.5, 7.5, 8.0), (4e-3, 0.0, 0.0, 4e-3))
wanted = middle + swing * np.sin(2.0 * np.pi * t)  # [m]

# %%
# The loop
# --------
# Here the clock is virtual: the loop runs as fast as possible. With a ``RealClock`` and a hardware
# rig, the code of the loop is the same.
clock, conditioner = VirtualClock(rate=1000.0), MatchedFilter(bandwidth=20.0)
bank = replace(
    paper_preset("soft"),
    estimators=("rls", "kalman"),
    correlation=conditioner.correlation(clock.period),
).bank()
log = []
with SimulatedRig(Cube(k1=2100.0, k3=0.0, b=15.0, glued=False), clock.now, start=-6e-3) as rig:
    rig.enable()
    for target in wanted:
        clock.wait()
        sample = rig.read()
        rig.write(Command(0.0, (target - sample.slave_position) / 0.02))
        x, v, f, _ = conditioner.update(sample.slave_position, sample.contact_force, clock.period)
        estimates = bank.update(x, v, f, clock.period)
        rls, kalman = estimates["rls"], estimates["kalman"]
        if not log or kalman.held != log[-1][-1]:
            state = "holds" if kalman.held else "learns"
            print(f"{sample.time:6.3f} s: {state}, {kalman.k:.0f} N/m")
        log.append((x, f, rls.k, kalman.k, kalman.held))

# %%
# The result
# ----------
# Where the background is grey, the gate is closed and ``kalman`` holds its estimate.
x, f, rls, k, held = np.array(log).T
print(f"in the air again: kalman has {k[-1]:.0f} N/m, rls has {rls[-1]:.0f} N/m")
figure, (signals, stiffness) = plt.subplots(
    2, 1, figsize=(8.0, 5.0), sharex=True, layout="constrained"
)
signals.plot(t, np.column_stack((x * 1e3, f)), label=("displacement [mm]", "force [N]"))
stiffness.plot(t, np.column_stack((rls, k)), label=("rls, not gated", "kalman, gated"))
signals.set(ylim=(-12.0, 32.0), xlim=(0.0, 12.0))
stiffness.set(xlabel="time [s]", ylabel="k [N/m]", ylim=(-300.0, 3300.0))
for axes in (signals, stiffness):
    across = axes.get_xaxis_transform()
    axes.fill_between(t, 0, 1, held > 0, transform=across, fc="0.93", ec="0.6", label="held")
    axes.legend(ncols=3, frameon=False, loc="upper right")
plt.show()
