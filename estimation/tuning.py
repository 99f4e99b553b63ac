"""Constants for the estimation methods that are not in the paper.

Most constants are relative to the settings of a preset. "Memory" is `MethodSettings.memory`, the
time constant of forgetting.

Most descriptions of the constants contain a settling time. It is measured in a test in which the
specimen is suddenly replaced by another specimen. The settling time is the time from this change
until the error of k remains below 5 %. `python benchmarks/tuning.py` prints the settling time and
the standard deviation of k due to noise. It prints them for the value of each constant and for
multiples of this value.

The constants for forgetting factors and forgetting rates are multiples of 0.25. For each of these
constants, the chosen multiple has the smallest standard deviation of k of all multiples with a
settling time of at most 0.3 s.
"""

from __future__ import annotations

CONDITIONAL_FORGETTING = 2.0
"""The forgetting factor of `rls_conditional` is the preset's forgetting factor to this power.

The settling time is 0.28 s, and 0.30 s for 0.8 times this value.
"""
CONDITIONAL_THRESHOLD = 1.5
"""Threshold c of `rls_conditional`, the midpoint of the useful range from 1 to m.

m = 2 is the number of parameters of the Kelvin-Voigt model.
"""
TRACE = 2.2e-4
"""Setting c1 of `rls_trace`, divided by m (1 - beta).

The settling time is 0.29 s, and 0.30 s for 0.8 times this value. Let q = phi_i^2 P0_i be the square
of a scaled regressor. With c1 = m (1 - beta) / q, `rls_trace` forgets as fast as `rls`. For
regressors of the typical sizes of a preset, q is 1e4. With this value, `rls_trace` then forgets 2.2
times as fast as `rls`.
"""
PASSIVE_FORGETTING = 1.25
"""The forgetting factor of `passive` is the preset's forgetting factor to this power.

The settling time is 0.29 s, and 0.31 s for 0.8 times this value.
"""
WINDOW = 2.0
"""Length of the window of the method `window`, in units of the memory.

Let w be weights that decay with a memory of N samples. A mean with these weights has as much noise
as a mean of (sum w)^2 / sum w^2 = 2 N samples of equal weight. So the window has 2 N samples.
"""
OBSERVER_MEMORY = 0.1
"""Time constant of the disturbance p of `observer`, in units of the memory.

p changes faster than the parameters. The settling time is not defined: after the exchange of the
cube, p contains the change of the force, and the error of k remains above 5 % for every time
constant. The standard deviation of k due to noise does not depend much on the time constant either.
So this value is not an optimum.
"""
NORMALISED_RATE = 0.55
"""Rate of `ai_normalised`, in units of 1 / memory.

The settling time is 0.59 s, and at least 0.50 s for all tested multiples of this value. A gradient
method cannot converge faster than the direction of the regressors changes.
"""
INDIRECT_RATE = 1.35
"""Rate of `indirect`, in units of 1 / memory.

The settling time is 0.64 s. It is 0.44 s for 0.8 times this value, and longer than 0.64 s for 0.5
and 2 times this value.
"""
REFERENCE_RATE = 1.25
"""Rate of `reference`, in units of 1 / memory. The settling time is 0.65 s. It is longer for all
tested multiples of this value."""
REFERENCE_BANDWIDTH = 10.0
"""Bandwidth of `reference`, in units of 1 / memory.

The bandwidth is eight times the rate. If the bandwidth is below four times the rate, the error of
the model oscillates.
"""
COMPOSITE_FORGETTING = 2.0
"""Forgetting rate of `composite`, in units of 1 / memory.

The settling time is 0.24 s, and 0.28 s for 0.8 times this value.
"""
COMPOSITE_BANDWIDTH = 5.0
"""Bandwidth of the filter of `composite`, in units of 1 / memory.

The settling times for 0.5 and 2 times this value differ by 0.01 s.
"""
LOGARITHMIC_MEMORY = 0.3
"""Time constant of forgetting in `hc_log`, in units of the memory.

The settling time is 0.26 s. It is 0.33 s for 1.25 times and 1.9 s for 0.8 times this value.
"""
SWITCHING_FORGETTING = 1.5
"""Forgetting rate of `me_switching`, in units of the forgetting rate of `me`.

The settling time is 0.28 s, and 0.33 s for 0.8 times this value.
"""
MOVING_FORGETTING = 1.25
"""Forgetting rate of `me_moving`, in units of the forgetting rate of `me`.

The settling time is 0.29 s, and 0.31 s for 0.8 times this value.
"""
SPECTRAL_MOTION = 0.02
"""The estimate of `spectral` does not change if the standard deviation of x is below this value.

The value is relative to the typical displacement. The gate of `scaled_preset` uses the same
fraction. For a typical displacement of 5 mm the limit is 0.1 mm, which is 100 counts of the
simulated encoder. In motion, 0.1 and 10 times this value give the same result.
"""
CONTACT_FORCE = 0.003
"""`hc_double` and `hc_log` ignore samples with a force below this value.

The value is relative to the typical force. For a typical force of 10 N this limit is 0.03 N, or 1.5
standard deviations of the noise in `benchmarks/bank_case.py`. 7 % of the noise samples exceed this
limit. The logarithm of a force below the limit is mostly noise. In contact, 0.1 and 10 times this
value give the same result.
"""
HYSTERESIS = 0.05
"""Hysteresis h of `me_switching`.

The settling time is 0.28 s, and noise causes 29 switches per second. With the settings of the paper
the memory is N = 33 samples. So the estimate does not change while its distance from the minimum is
at most sqrt(h N) = 1.3 standard deviations. With 0.1 times this value there are 69 switches per
second. With 10 times this value there are 2 switches per second, and the settling time is 0.33 s.
"""
DWELL = 0.25
"""Minimum time between switches of `me_switching`, in units of the memory.

In a quarter of the memory the monitoring signal of a candidate changes by 1 - exp(-1/4) = 22 %. The
settling time is 0.28 s. The settling times for 0.5 times and 2 times this value differ by 0.02 s.
For 10 times this value, the settling time is 0.37 s.
"""
PATIENCE = 0.5
"""If the best candidate was not at the edge during this time, `me_moving` refines its grid.

The time is in units of the memory. The settling time is 0.29 s for this value, and also for 0.1
times and 2 times this value. The settling time is 0.94 s for 10 times this value.
"""
FIRST_SPACING_B = 1.0 / 40.0
"""Initial spacing of b of `me_moving`, in units of typical force / typical velocity.

With 16 candidates on either side of zero, the initial grid extends to 0.4 times typical force /
typical velocity. The spacing then adapts, so 0.1 and 10 times this value give the same result.
"""
FIRST_SPACING_K = 0.25
"""Initial spacing of k of `me_moving`, in units of typical force / typical displacement.

The initial grid extends to 4 times typical force / typical displacement. The spacing then adapts,
so 0.1 and 10 times this value give the same result.
"""
