"""Thresholds of tracking, felt stiffness and stability."""

from __future__ import annotations

# Oscillation of the loop

FASTEST_HAND = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
LEAST_DAMPING = 2.0
"""Damping that any arm has at least [N s/m]."""
SUSTAINING = 0.75
"""Smallest ratio r of -Re{Z} to the damping Re{Z_a} of a known arm at which motion is counted as an
oscillation of the loop. In an oscillation without tremor, r is 1. At a resonance of arm and
environment, the environment multiplies the velocity of the tremor by 1 / (1 - r), compared with an
environment with Re{Z} = 0."""

# Felt stiffness

SETTLING = 4.0
"""Time at the start of a trial that is omitted [s], because the model of the specimen that the
master renders has not converged. At most half of the trial is omitted."""
LEAST_FORCE = 0.5
"""Contact force, multiplied by the force gain, above which a tick is evaluated [N]."""
LATE_REPORT = 0.5
"""Age of the newest packet of the slave above which the channel is named as the cause [s]."""
BLOCK = 0.01
"""Time over which force and position are averaged for the comparison [s]."""
MOST_BLOCKS = 60_000
"""Number of blocks that are kept for the comparison; those of 10 min."""
FEWEST_BLOCKS = 10
"""Smallest number of blocks in contact."""
MOST_TISSUE_MISFIT = 0.1
"""Relative rms error of the law of the tissue above which a remark states that there is none."""
BEHIND = 0.15
"""Largest relative difference between the tip and the scaled position of the hand without
remark."""
NOTICEABLE = 0.23
"""Smallest relative difference of stiffness that a person notices (L. A. Jones, I. W. Hunter, Exp.
Brain Res. 79, 1990, 150-156: Weber fraction of 0.23)."""
SEGMENT = 2.56
"""Duration of the segments whose spectra are averaged for the impedance [s]."""
LEAST_POWER = 1e-4
"""Power of the velocity of the hand at a frequency, divided by the largest one, above which the
impedance at this frequency is evaluated."""
SMALLEST_MOTION = 0.5e-3
"""Depth below which lost motion of a tenth of a millimetre, as on the simulated rig, prevents an
estimate of the specimen [m]."""
MOST_PRIOR = 0.05
"""Largest share of the ticks without remark at which the hand feels the stiff prior. After a change
of the specimen, the model-mediated law returns to the prior for about 0.2 s."""

# Tracking of the target

FEWEST_PERIODS = 2.0
"""Smallest number of periods of the target for which the tracking is computed."""
INCOMPLETE_PERIOD = 0.02
"""Fraction of a period by which the last period may be incomplete, so that a few missing ticks do
not exclude a whole period."""
LARGEST_LEAD = 0.25
"""Greatest lead of the position, as a fraction of the period. A larger lead is treated as a
delay."""
FREQUENCY_SPAN = 2.0
"""Limits of the search for the achieved frequency: the target frequency divided by this factor, and
multiplied by this factor."""
