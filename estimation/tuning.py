"""Tuning constants of the estimation methods that this package adds to those of the paper.

The paper is Yamamoto et al., BioRob 2008 (README). Names such as `rls_conditional` are names of
estimation methods. Most constants are relative to a setting of the preset. A preset contains the
settings of all methods (`MethodSettings`). "Memory" is `MethodSettings.memory`, the time constant
of forgetting.

Most descriptions of the constants contain a settling time. It is measured in a simulation in which
the specimen is suddenly replaced by another specimen. The settling time is the time from this
change until the error of k remains below 5 %. `python benchmarks/tuning.py` prints two results for
the value of each constant, and for multiples of this value: the settling time, and the standard
deviation of k due to noise.

The constants for forgetting factors and forgetting rates are multiples of 0.25. Among the multiples
with a settling time of at most 0.3 s, the one with the smallest standard deviation of k is chosen.
"""

from __future__ import annotations

CONDITIONAL_FORGETTING = 2.0
"""The forgetting factor of `rls_conditional` is the preset's forgetting factor to this power.

The settling time is 0.28 s, and 0.30 s for 0.8 times this value.
"""
CONDITIONAL_THRESHOLD = 1.5
"""Threshold c of `rls_conditional`, which uses only samples with enough information.

The value is the midpoint of the useful range from 1 to m, where m = 2 is the number of parameters
of the Kelvin-Voigt model.
"""
TRACE = 2.2e-4
"""Setting c1 of `rls_trace`, divided by m (1 - beta).

c1 is the trace of the covariance matrix, m the number of parameters, and beta the forgetting factor
of `rls`. The settling time is 0.29 s, and 0.30 s for 0.8 times this value.

Let q = phi_i^2 P0_i, where phi_i is a regressor and P0_i the initial variance of its parameter.
With c1 = m (1 - beta) / q, `rls_trace` forgets as fast as `rls`. For regressors with the typical
values of a preset, q is 1e4. So `rls_trace` forgets 2.2e-4 * 1e4 = 2.2 times as fast as `rls`.
"""
PASSIVE_FORGETTING = 1.25
"""The forgetting factor of `passive` is the preset's forgetting factor to this power.

The settling time is 0.29 s, and 0.31 s for 0.8 times this value.
"""
WINDOW = 2.0
"""Length of the window of the method `window`, in units of the memory.

With exponential forgetting, the weights w of the samples decay with a memory of N samples. A mean
with such weights has the same noise as a mean of (sum w)^2 / sum w^2 = 2 N samples of equal weight.
So the window has 2 N samples.
"""
OBSERVER_MEMORY = 0.1
"""Time constant of the disturbance force p that `observer` estimates, in units of the memory.

p changes faster than b and k. The settling time is not defined: after the specimen was replaced, p
contains the change of the force, and the error of k remains above 5 % for every time constant. The
standard deviation of k due to noise depends only little on the time constant. So this value is not
an optimum.
"""
NORMALISED_RATE = 0.55
"""Rate of `ai_normalised`, in units of 1 / memory.

The settling time is 0.59 s, and at least 0.50 s for all tested multiples of this value. This method
is a gradient method. It cannot converge faster than the ratio of the regressors v and x changes.
"""
INDIRECT_RATE = 1.35
"""Rate of `indirect`, in units of 1 / memory.

The settling time is 0.64 s. It is 0.44 s for 0.8 times this value, and longer than 0.64 s for 0.5
and 2 times this value.
"""
REFERENCE_RATE = 1.25
"""Rate of `reference`, in units of 1 / memory.

The settling time is 0.65 s. It is longer for all tested multiples of this value.
"""
REFERENCE_BANDWIDTH = 10.0
"""Bandwidth of the reference model of `reference`, in units of 1 / memory.

The bandwidth is eight times the rate. If the bandwidth were below four times the rate, the error of
the model would oscillate.
"""
COMPOSITE_FORGETTING = 2.0
"""Forgetting rate of `composite`, in units of 1 / memory.

The settling time is 0.24 s, and 0.28 s for 0.8 times this value.
"""
COMPOSITE_BANDWIDTH = 5.0
"""Bandwidth of the filter of `composite`, in units of 1 / memory.

The settling time for 0.5 times this value and that for 2 times this value differ by 0.01 s.
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
"""The estimate of `spectral` does not change if the standard deviation of x is below this limit.

The limit is relative to the typical displacement. For a typical displacement of 5 mm it is 0.1 mm,
which is 100 increments of the simulated encoder. The thresholds of the contact gate in
`scaled_preset` are also 2 % of typical values. In motion, 0.1 and 10 times this value give the same
result.
"""
CONTACT_FORCE = 0.003
"""`hc_double` and `hc_log` ignore samples with a force below this limit.

The limit is relative to the typical force. For a typical force of 10 N it is 0.03 N, or 1.5
standard deviations of the noise in `benchmarks/bank_case.py`. Without contact, the force of 7 % of
the samples exceeds this limit. The logarithm of a force below the limit is mostly noise. In
contact, 0.1 and 10 times this value give the same result.
"""
HYSTERESIS = 0.05
"""Hysteresis h of `me_switching`, which switches between candidates (b, k).

The selected candidate changes only if its monitoring signal exceeds 1 + h times the smallest
monitoring signal. With the settings of the paper, the memory is N = 33 samples. So the candidate
does not change while it is at most sqrt(h N) = 1.3 standard deviations away from the minimum.

The settling time is 0.28 s, and noise causes 29 switches per second. With 0.1 times this value
there are 69 switches per second. With 10 times this value there are 2 switches per second, and the
settling time is 0.33 s.
"""
DWELL = 0.25
"""Minimum time between two switches of `me_switching`, in units of the memory.

During this time, the weight of the past samples in `me_switching` decreases by
1 - exp(-`SWITCHING_FORGETTING` / 4) = 31 %. The settling time is 0.28 s, and 0.37 s for 10 times
this value. The settling time for 0.5 times this value and that for 2 times this value differ by
0.02 s.
"""
PATIENCE = 0.5
"""Time after which `me_moving` halves the spacing of its grid, in units of the memory.

The spacing is halved if the best candidate was not at the edge of the grid during this time. The
settling time is 0.29 s for this value, and also for 0.1 times and 2 times this value. The settling
time is 0.94 s for 10 times this value.
"""
FIRST_SPACING_B = 1.0 / 40.0
"""Initial spacing of b in `me_moving`, in units of typical force / typical velocity.

The grid has 16 values of b on either side of zero. So the initial grid extends to 0.4 times typical
force / typical velocity. The spacing is then adapted, so that 0.1 and 10 times this value give the
same result.
"""
FIRST_SPACING_K = 0.25
"""Initial spacing of k in `me_moving`, in units of typical force / typical displacement.

The grid has 16 values of k on either side of zero. So the initial grid extends to 4 times typical
force / typical displacement. The spacing is then adapted, so that 0.1 and 10 times this value give
the same result.
"""
