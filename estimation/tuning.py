"""Tuning of the methods other than the paper's, relative to the settings of a preset.

Each docstring gives the settling time in seconds: the time until k is within 5 % of the true value
after the cube was exchanged. `python benchmarks/tuning.py` prints it for each value and its
multiples, together with the standard deviation of k due to noise. Forgetting factors and rates were
chosen in steps of 0.25, for the least deviation with a settling time of at most 0.3 s.
"""

from __future__ import annotations

CONDITIONAL_FORGETTING = 2.0
"""Power of the forgetting factor for `rls_conditional`: 0.28 s; 0.30 s for 0.8 times the value."""
CONDITIONAL_THRESHOLD = 1.5
"""Threshold c of `rls_conditional`: the midpoint of its useful range from 1 to m = 2."""
TRACE = 2.2e-4
"""c1 of `rls_trace`, in units of m (1 - beta): 0.29 s; 0.30 s for 0.8 times the value.

With 1 / q, where q = phi_i^2 P0_i is the square of a scaled regressor, it forgets as fast as beta
does. At the typical sizes of a preset q is 1e4, so this value forgets 2.2 times as fast.
"""
PASSIVE_FORGETTING = 1.25
"""Power of the forgetting factor for `passive`: 0.29 s; 0.31 s for 0.8 times the value."""
WINDOW = 2.0
"""Length of `window`, in units of the memory.

Weights w that decay with a memory of N samples have an effective number of samples of
(sum w)^2 / sum w^2 = 2 N.
"""
OBSERVER_MEMORY = 0.1
"""Memory of the disturbance of `observer`, in units of the memory: faster than the parameters.

The settling time is not defined: for every value, the disturbance absorbs the force change when
the cube is exchanged, and k stays more than 5 % off. The deviation due to noise hardly depends on
the value either. So the value is a choice, not an optimum.
"""
NORMALISED_RATE = 0.55
"""Rate of `ai_normalised`, per memory: 0.59 s; no multiple is below 0.50 s.

A gradient method does not converge faster than the direction of the regressors changes.
"""
INDIRECT_RATE = 1.35
"""Rate of `indirect`, per memory: 0.64 s; 0.44 s for 0.8 times it, longer for 0.5 and 2 times."""
REFERENCE_RATE = 1.25
"""Rate of `reference`, per memory: 0.65 s, the shortest of its multiples."""
REFERENCE_BANDWIDTH = 10.0
"""Bandwidth of `reference`, per memory: eight times its rate. Below four times it oscillates."""
COMPOSITE_FORGETTING = 2.0
"""Forgetting rate of `composite`, per memory: 0.24 s; 0.28 s for 0.8 times the value."""
COMPOSITE_BANDWIDTH = 5.0
"""Bandwidth of the filter of `composite`, per memory: 0.5 and 2 times it differ by 0.01 s."""
LOGARITHMIC_MEMORY = 0.3
"""Memory of `hc_log`, in units of the memory: 0.26 s; 0.33 s for 1.25 times, 1.9 s for 0.8."""
SWITCHING_FORGETTING = 1.5
"""Forgetting rate of `me_switching`, relative to `me`: 0.28 s; 0.33 s for 0.8 times the value."""
MOVING_FORGETTING = 1.25
"""Forgetting rate of `me_moving`, relative to `me`: 0.29 s; 0.31 s for 0.8 times the value."""
SPECTRAL_MOTION = 0.02
"""Standard deviation of x below which `spectral` is held, relative to the typical displacement.

The gate of `scaled_preset` uses the same fraction. For the typical 5 mm it is 0.1 mm, a hundred
counts of the simulated encoder. In motion, 0.1 and 10 times the value make no difference.
"""
CONTACT_FORCE = 0.003
"""Force below which `hc_double` and `hc_log` detect no contact, relative to the typical force.

For the typical 10 N it is 0.03 N, 1.5 standard deviations of the noise in
`benchmarks/bank_case.py`. 7 % of the noise samples exceed it, and the logarithm of a smaller force
is mostly noise. In contact, 0.1 and 10 times the value make no difference.
"""
HYSTERESIS = 0.05
"""Hysteresis h of `me_switching`: 0.28 s, and 29 switches in 1 s of noise.

With the paper's settings the memory is N = 33 samples. So the estimate is kept while it is within
sqrt(h N) = 1.3 standard deviations of the minimum. 0.1 times the value gives 69 switches per
second; 10 times the value gives 2, but a settling time of 0.33 s.
"""
DWELL = 0.25
"""Minimum time between switches of `me_switching`, in units of the memory: 0.28 s.

In a quarter of the memory the signal of a candidate changes by 22 %, 1 - exp(-1/4). The settling
times of 0.5 and 2 times the value differ by 0.02 s; it is 0.37 s for 10 times the value.
"""
PATIENCE = 0.5
"""Time away from the grid's edge until `me_moving` refines the grid, in units of the memory.

The settling time is 0.29 s, also for 0.1 and 2 times the value; it is 0.94 s for 10 times.
"""
FIRST_SPACING_B = 1.0 / 40.0
"""Initial spacing of b of `me_moving`, in units of typical force / typical velocity.

With 16 candidates on either side, the initial grid extends to 0.4 times the damping that would
explain the whole force. The spacing then adapts: 0.1 and 10 times the value make no difference.
"""
FIRST_SPACING_K = 0.25
"""Initial spacing of k of `me_moving`, in units of typical force / typical displacement.

The initial grid extends to 4 times the stiffness that would explain the whole force. The spacing
then adapts: 0.1 and 10 times the value make no difference.
"""
