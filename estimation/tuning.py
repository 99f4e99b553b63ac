"""How the methods that are not the paper's are tuned, relative to the settings of a preset.

`python benchmarks/tuning.py` shows, for each value and its multiples, how long k takes to come
within 5 % of a cube that was swapped, and how much it follows noise. A docstring gives that time in
seconds. The forgetting values are those that follow noise least, in steps of a quarter, and still
take at most 0.3 s.
"""

from __future__ import annotations

CONDITIONAL_FORGETTING = 2.0
"""Power of the forgetting factor for `rls_conditional`: 0.28 s, and 0.30 s with 0.8 times it."""
CONDITIONAL_THRESHOLD = 1.5
"""c of `rls_conditional`: in the middle between 1 and m = 2, the bounds that it belongs between."""
TRACE = 2.2e-4
"""c1 of `rls_trace`, times m (1 - beta): 0.29 s, and 0.30 s with 0.8 times it.

It forgets as beta does with 1 / q, q = phi_i^2 P0_i the square of a scaled regressor. At the
typical size of a preset q is 1e4, so this is 2.2 times what forgets as beta does there.
"""
PASSIVE_FORGETTING = 1.25
"""Power of the forgetting factor for `passive`: 0.29 s, and 0.31 s with 0.8 times it."""
WINDOW = 2.0
"""Length of `window` in memories.

Weights w that decay over a memory of N samples count as (sum w)^2 / sum w^2 = 2 N equal ones.
"""
OBSERVER_MEMORY = 0.1
"""Memory of the disturbance of `observer`, in memories: it moves faster than the parameters.

No value brings `observer` within 5 % after a swap, since the disturbance takes up the force of the
swap; the deviation from noise hardly depends on it either. It is a choice, not a result.
"""
NORMALISED_RATE = 0.55
"""Rate of `ai_normalised`, per memory: 0.59 s; no multiple takes less than 0.50 s.

A gradient is not faster than the motion turns its regressors.
"""
INDIRECT_RATE = 1.35
"""Rate of `indirect`, per memory: 0.64 s; 0.8 times it takes 0.44 s, half and twice it more."""
REFERENCE_RATE = 1.25
"""Rate of `reference`, per memory: 0.65 s, the least of its multiples."""
REFERENCE_BANDWIDTH = 10.0
"""Bandwidth of `reference`, per memory: eight times its rate, as it rings below four times."""
COMPOSITE_FORGETTING = 2.0
"""Forgetting rate of `composite`, per memory: 0.24 s, and 0.28 s with 0.8 times it."""
COMPOSITE_BANDWIDTH = 5.0
"""Bandwidth of the filter of `composite`, per memory: half and twice it differ by 0.01 s."""
LOGARITHMIC_MEMORY = 0.3
"""Memory of `hc_log`, in memories: 0.26 s; 1.25 times it takes 0.33 s, and 0.8 times it 1.9 s."""
SWITCHING_FORGETTING = 1.5
"""Forgetting rate of `me_switching` by that of `me`: 0.28 s, and 0.33 s with 0.8 times it."""
MOVING_FORGETTING = 1.25
"""Forgetting rate of `me_moving` by that of `me`: 0.29 s, and 0.31 s with 0.8 times it."""
SPECTRAL_MOTION = 0.02
"""Deviation of x up to which `spectral` is held, in typical displacements.

The share at which the gate of `scaled_preset` shuts. At the typical 5 mm it is 0.1 mm, a hundred
counts of the simulated encoder. In motion a tenth and ten times it make no difference.
"""
CONTACT_FORCE = 0.003
"""Force up to which `hc_double` and `hc_log` see no contact, in typical forces.

At the typical 10 N it is 0.03 N, 1.5 deviations of the noise of `benchmarks/bank_case.py`: 7 % of
the noise exceeds it, and the logarithm of a smaller force is mostly noise. In contact a tenth and
ten times it make no difference.
"""
HYSTERESIS = 0.05
"""h of `me_switching`: 0.28 s and 29 switches in 1 s of noise.

Its memory with the paper's settings is N = 33 samples, so that the estimate stays while it is
within sqrt(h N) = 1.3 deviations of the least point. A tenth of it switches 69 times a second; ten
times it, twice, but takes 0.33 s.
"""
DWELL = 0.25
"""Least time between switches of `me_switching`, in memories: 0.28 s.

In a quarter of its memory the signal of a candidate changes by a fifth, 1 - exp(-1/4). Half and
twice it differ by 0.02 s; ten times it takes 0.37 s.
"""
PATIENCE = 0.5
"""Time away from its grid's edge after which `me_moving` narrows the grid, in memories: 0.29 s.

Twice it and a tenth of it take as long; ten times it takes 0.94 s.
"""
FIRST_SPACING_B = 1.0 / 40.0
"""First spacing of b of `me_moving`, in typical forces by typical velocities.

With 16 candidates to either side the first grid reaches to 0.4 of the damping that would explain
the whole force. The spacing then adapts: a tenth and ten times it make no difference.
"""
FIRST_SPACING_K = 0.25
"""First spacing of k of `me_moving`, in typical forces by typical displacements.

The first grid reaches to four times the stiffness that would explain the whole force. The spacing
then adapts: a tenth and ten times it make no difference.
"""
