"""Thresholds of the batch evaluation.

A length, force or time is compared with a fraction of its range in the record, so that the result
does not depend on the size of the specimen, and with a multiple of its noise, so that noise is not
taken for motion or contact: white Gaussian noise exceeds 4 standard deviations in one of 16 000
samples, 5 in one of 1.7 million, and 6 in one of 500 million.
"""

from __future__ import annotations

from estimation.baseline import FEWEST_CYCLES

# Sampling and smoothing

FEWEST_IN_PIECE = 16
"""Smallest number of samples in a piece between two gaps. Shorter pieces are not used."""
SMOOTHING_CORNER = 5.0
"""Corner frequency of the smoothing kernel, as a multiple of the upper end of the coherent band. In
this band of frequencies, the force follows the displacement."""
WIDEST_KERNEL = 0.04
"""Largest width of the smoothing kernel, as a fraction of the median duration of a loading
phase."""
SINE_SHARE = 0.9
"""Fundamental share (see `SmoothedRecord.fundamental_share`) above which a motion counts as a sine.
The share is 1 for a sine and 0.84 for a triangle wave."""
SHARP_CORNER_NOISE = 5.0
"""Smallest difference between measured and smoothed values that indicates a sharp corner of the
signal, in standard deviations of the noise."""

# Faults of the logger and the data stream

HELD_STEPS = 2.5
"""Smallest change of a channel, in steps of its resolution, that shows whether samples are held.
Without held samples, a smaller change can follow on several equal values."""
FEWEST_UPDATES = 20
"""Smallest number of updates by which a held channel is recognised."""
REGULAR_UPDATES = 0.9
"""Smallest share of the updates of a held channel that have the typical distance."""
FEWEST_STALLED = 20
"""Smallest number of equal samples in a stalled stream."""
SHORTEST_STALL = 0.01
"""Shortest stall of a stream that is searched, as a fraction of the record."""
LEAST_STALLED_FORCE = 0.2
"""Smallest difference of the force from that at the same position at other times that shows a
stalled stream, as a fraction of the force range. Hysteresis and relaxation are smaller."""
LEAST_DROP = 0.1
"""Smallest jump to and from a constant value of a channel without signal, as a fraction of the
range of the channel."""
STALL_MARGIN = 0.05
"""Positions or forces count as different if they differ by more than this fraction of their
range."""
STALLED_SHARE = 0.3
"""Smallest share of the constant samples at which the pair of position and force must differ from
that at other times."""

# Spikes of the force

LEAST_SPIKE = 0.5
"""Smallest spike of the force, as a fraction of the range of the force (percentiles 1 to 99). The
highest sample of a contact of four samples exceeds its neighbours by up to 0.3 of the range."""
SPIKE_SCATTER = 12.0
"""Smallest spike, in standard deviations of the difference of successive samples. This difference
is large if the motion has few samples per cycle."""
SPIKE_NEIGHBOURS = 3.0
"""Smallest spike, as a multiple of the difference of the samples before and after it. A step of the
force, as in a puncture, is a smaller multiple."""
MOST_SPIKES = 0.01
"""Largest share of the samples that are spikes. More of them are not isolated faults."""

# Interference

LEAST_LINE = 0.02
"""Smallest amplitude of interference that is reported, as a fraction of the force range."""
LINE_FLOOR = 8.0
"""Smallest amplitude of interference, as a multiple of the median of the spectrum near it. White
noise exceeds 4 times the median in one of 65 000 bins."""
LINE_RESPONSE = 5.0
"""Smallest amplitude of interference, as a multiple of the force that the position at the same
frequency causes."""
LINE_NEIGHBOURS = 4.0
"""Smallest amplitude of a harmonic that is interference, as a multiple of those of the two
harmonics below and above it. The harmonics of a body in contact decrease with their order."""
LINE_WIDTH = 3
"""Distance from the maximum of a line at which the spectrum with a Hann window is low [bins]."""
FEWEST_LINE_CYCLES = 6
"""Smallest number of cycles with which lines between harmonics are distinguished from them."""

# Sines with few samples per cycle, or with coarse rounding

COARSE_SAMPLES_PER_CYCLE = 16.0
"""Number of samples per cycle below which a harmonic fit is used instead of smoothed signals."""
COARSE_COUNTS = 30.0
"""Range of position or force, in steps of its resolution, below which a harmonic fit is used."""
FEWEST_HARMONIC_SAMPLES_PER_CYCLE = 3.9
"""Smallest number of samples per cycle with which a harmonic fit is used. Below it, the second
harmonic of a body appears below the fundamental, and cannot be distinguished from noise."""
HARMONIC_BLOCK_CYCLES = 2
"""Smallest number of cycles of a block."""
FEWEST_HARMONIC_BLOCKS = 3
"""Smallest number of blocks from whose scatter an interval is computed."""
MOST_HARMONIC_BLOCKS = 20
"""Largest number of blocks. The quantile of their scatter is then 2.1."""
LARGEST_HARMONIC = 5
"""Largest order of the harmonics that are fitted."""
LARGEST_DISTORTION = 0.05
"""Largest harmonics of position and force, relative to the fundamental, of a sine on a body that
counts as linear."""
LARGEST_AMPLITUDE_CHANGE, LARGEST_PHASE_CHANGE, LARGEST_REST = 0.2, 0.5, 0.2
"""Largest relative change of the amplitude of the blocks, largest change of their phase [rad], and
largest part of the position besides the harmonics, relative to the amplitude, of a steady sine."""
ROUNDING_BINS = 1000
"""Largest number of phases of a cycle that are distinguished."""

# Signs and times of the channels

OPPOSITE_SIGNS = -0.25
"""Correlation of the changes of force and position below which their signs are opposite. In 260
records of 13 kinds with right signs, it is above 0.4."""
LONGEST_LAG = 0.05
"""Longest lag of a force channel [s] that is named as a cause of negative damping. Filters of force
sensors with a cutoff frequency of 10 Hz or more are faster, up to the third order (32 ms)."""
LAG_MISFIT = 2.0
"""Largest residual with a lag of the force instead of a relaxation, in standard deviations of the
noise of the smoothed force. A lag describes the force of a body that does not relax down to the
noise; on a poroelastic body in ramps, it leaves 11 standard deviations."""
LARGEST_CHANGE_BY_LAG = 0.1
"""If a lag of the force describes it as well as a relaxation, the largest difference of b between
the two, relative to b, with which b is reported. Its interval then contains both values."""
LONGEST_LAG_SHARE = 0.125
"""Longest lag of a force channel that is named as a cause of negative damping, in periods of the
motion."""
STEEPEST_LOSS = 0.64
"""Largest magnitude of negative loss factor (b omega / k) that lost motion can cause in a record
that determines k: the play operator has 2 / pi if the lost motion is half of the amplitude."""
LAGGING_R2 = 0.8
"""Smallest R^2 of a linear fit to position and velocity from which a long lag is concluded."""

# Strokes and cycles of the motion

LEAST_STROKE = 0.2
"""Smallest stroke in a record that is mostly at rest, as a fraction of the range of the position.
A stroke is the motion between two successive reversals."""
LEAST_WHOLE_STROKE = 0.7
"""Smallest inward stroke that is used, relative to the median stroke. The first stroke is smaller
if the motion begins in the middle of its range."""
FEWEST_INNER_STROKES = 5
"""If there are more inward strokes, the first and the last are not used, because the removal of the
baseline shifts them."""
REGULAR_CYCLE = 0.5
"""Largest relative difference of the duration of a cycle from the typical duration, which is the
median. If the number of cycles is even, it is the shorter one of the two middle cycles."""
LEAST_FOLLOWED_SLOPE = 0.1
"""Smallest slope of the force in a stroke on a specimen, relative to the mean slope. On the cubes
of the simulated rig, the slope at the surface is at least 0.13 times the mean slope up to 40 N."""
FEWEST_STROKES = round(2 * FEWEST_CYCLES) - 1
"""Smallest number of whole strokes for which a frequency is computed. A stroke is the motion from
one reversal to the next."""
LEAST_STROKE_NOISE = 6.0
"""Smallest median travel of the strokes that counts as a motion, in standard deviations of the
noise of the position."""
LARGEST_BACKWARD_MOTION = 0.05
"""Largest motion in the opposite direction that does not count as a reversal, as a fraction of the
travel."""
LEAST_TRAVEL_NOISE = 25.0
"""Least travel, in standard deviations of the noise of the position."""
LEAST_RISE_OF_FORCE = 4.0
"""Least change of the force, in standard deviations of its scatter about a parabola over the
position."""
STROKE_BAND_END = 5.0
"""Upper end of the band, as a multiple of the inverse of the duration of the motion. With this
value, about 80 independent samples are fitted in a stroke that is in contact throughout."""
WIDEST_COHERENT_BAND = 3.0
"""Largest upper end of the coherent band, as a multiple of the upper end of the stroke band. The
limit is necessary because the tapers of the coherent band leak a little power from the ends of a
slow stroke to all frequencies."""

# Contact and phases

LEAST_LEVEL_WIDTH = 0.015
"""Smallest value of `level_width`, as a fraction of the force range."""
LEVEL_WIDTH_NOISE = 6.0
"""Smallest value of `level_width`, in standard deviations of the noise of the smoothed force."""
MOST_LEVEL_WIDTHS = 2.0
"""Largest range of a force that counts as constant (percentiles 5 to 95), in `level_width`. The
noise of the smoothed force has a range of about half of `level_width`."""
LEAST_TURN = 0.05
"""Smallest reversal of the motion that separates loading from unloading, as a fraction of the
travel."""
LARGEST_HOLD_MOTION = 0.02
"""Largest change of the position in a hold, as a fraction of the range of the monotone part."""
SHORTEST_HOLD = 0.33
"""Shortest hold, as a fraction of the median duration of the motion in the monotone parts."""
GUARD_WIDTHS = 3.5
"""Samples nearer than this distance to the beginning or end of a contact are not fitted. The unit
is the standard deviation of the smoothing kernel."""
JUMP_WIDTHS, JUMP_SLOPE = 4.5, 2.0
"""Distance from the beginning or end of a contact in which the force can jump, in standard
deviations of the smoothing kernel, and smallest slope there, relative to that at this distance."""
LONG_RECORD_GUARDS = 4
"""Samples near the start and the end of a record (nearer than `GUARD_WIDTHS`) are not fitted if the
record is long. The record is long if it has more than `LONG_RECORD_GUARDS` times this number of
samples in contact for each start, gap and end."""
FREE_TRAVEL = 4.0
"""Smallest travel at a nearly constant force that counts as free motion or as saturation, as a
multiple of the travel that the stiffness of the specimen permits."""
LAG_FACTOR = 1.5
"""Safety factor on the travel between a peak of the force and the later peak of the position."""
LARGEST_FLAT = 0.15
"""Largest depth of a trough (`peak_height`) whose force counts as flat, as a fraction of the
parameter `width` of `free_and_saturated`. It is 4/9 for a round trough."""
LEAST_MOVED = 0.5
"""The travel is computed from the position without its baseline. The position with its baseline
must travel at least this fraction of the required travel. Otherwise the tip is at rest, and only
the removed baseline changes."""
LEAST_PEAK = 0.3
"""Smallest height (`peak_height`) of a smooth peak of the force, as a fraction of the parameter
`width` of `free_and_saturated`. A force with a smaller height counts as constant."""
LEAST_FOLLOWED_R2, LEAST_FOLLOWED_STIFFNESS = 0.9, 0.3
"""Smallest R^2 of a fit of position and velocity to a force that seems constant, and smallest
fitted stiffness, relative to the median stiffness at slightly larger forces, with which the force
is that of contact. A part of free motion ends with contact at most a quarter as steep: the force
changes by a quarter of the product of stiffness and travel (`FREE_TRAVEL`), and not in proportion
to it. In contact, the stiffness at the lowest force was 0.46 of the median of a stiffening body."""
CLIPPING_LENGTH = 2.0
"""Least duration for which the maximum of the force is repeated, relative to the 95th percentile of
the durations for which other large values are repeated."""
SHORTEST_CLIPPING = 3
"""Smallest number of successive samples at exactly the highest force that indicate saturation."""
FEWEST_CLIPPED = 8
"""Smallest number of all samples at exactly the highest force that indicate saturation."""

# Drift of the force out of contact

LOWEST_FORCES = 1.0
"""Percentile of the force between two deepest positions that counts as its minimum [%]."""
LOWEST_POSITIONS = 0.05
"""Part of the travel between two deepest positions at which the drift in this time is estimated."""
LARGEST_PART_DRIFT = 0.3
"""Largest drift between two deepest positions, as a fraction of the range of the force."""
FEWEST_FREE_SAMPLES = 4
"""Smallest number of samples in each part of a time out of contact."""
MOST_FREE_PARTS = 6
"""Largest number of parts of a time out of contact whose forces are averaged."""
SHORTEST_FREE_SPAN = 0.5
"""Shortest time from the first to the last time out of contact, as a fraction of the record."""
HIGHEST_DRIFT_DEGREE, FEWEST_SPARE_TIMES = 6, 3
"""Highest degree of a polynomial drift, and smallest difference of the number of times and it."""
DRIFT_ERRORS, TERM_ERRORS = 6.0, 2.0
"""Smallest drift, and smallest term of its highest degree, in standard deviations. A term that is
not needed costs less than one that is left out."""
LARGEST_DRIFT_MISFIT = 2.0
"""Largest difference of the forces out of contact from a polynomial drift (root mean square), in
standard deviations of these forces. Beyond it, the drift is interpolated."""
ROUGHEST_DRIFTS = {1.0: 3.0, 1.35: 10.0}
"""Largest difference of successive mean forces out of contact, relative to their standard deviation
(root mean squares), with which a drift is interpolated, and smallest such deviation in errors. The
ratio is 1.4 for noise, and 1.2 for four times of which two are before a jump."""
LEAST_FREE_DRIFT = 0.005
"""Smallest drift that is removed, as a fraction of the range of the force."""

# Fit of the models in contact

FEWEST_FIT_SAMPLES = 10
"""Smallest number of independent samples for a fit: in contact for a model, and in a hold for the
relaxation."""
SPARE_SAMPLES = 6
"""Smallest difference between number of samples and number of parameters."""
STEADY_FREE_FORCE = 0.01
"""Largest standard deviation of the force out of contact, as a fraction of the force range, for
which this force counts as steady."""
LEAST_SPEED_NOISE = 4.0
"""Least speed in loading, in standard deviations of the noise of the smoothed velocity."""
SLOPE_BAND = 0.08
"""Samples are used for the slope if the distance of their force from half of the force range is
less than this fraction of the range."""
FEWEST_SLOPE_SAMPLES = 3
"""Smallest average number of samples for the slope in one pass through half of the force range. If
there are fewer, the neighbouring samples are used in addition (`with_neighbours`)."""
LEAST_SLOPE_STEP_NOISE = 50.0
"""Smallest distance between two positions from which a slope is computed (`surroundings`), in
standard deviations of the noise of the smoothed position."""
SMOOTHING_ERROR = 0.0005
"""Relative standard deviation of k due to smoothing and resampling, for models with relaxing parts.

This value is the median error of k for synthetic records without noise
(`estimation.testing_records`). For a model without relaxing parts the error is zero, because such a
model holds exactly for the smoothed signals.
"""
LARGEST_TIME_RATIO = 3.0
"""Largest upper end of the interval of a time constant, relative to its value, with which the
interval is printed. Beyond it, only the order of magnitude is known."""
LEAST_R2_FOR_RELAXATION = 0.9
"""If the baseline contains cosines, relaxing parts and extensions are fitted only if R^2 without
them exceeds this value. A larger misfit is not caused by relaxation: the baseline describes slow
relaxation."""
NEGLIGIBLE_BIC = 60.0
"""Difference of the Bayesian information criterion from which a model is ignored. The weight of
such a model is less than exp(-30) times that of the best model."""
LEAST_MISFIT = 1e-3
"""Residual of the best model below which no extension is tried, as a fraction of the force (root
mean square). A part of the force of this size changes k by at most about 0.1 %."""
RELAXATION_MISFIT = 4.0
"""Residual of a model that relaxes, in standard deviations of the noise of the smoothed force,
above which softening by the largest depth (Mullins effect) is named as another cause. It is 1 to 2
on bodies that relax, and 8 to 30 on bodies that soften."""
LOADING_BAND = 0.15
"""Samples are used for the slope of the measured force in loading if the distance of their force
from the middle is less than this fraction of the range. A cubic polynomial is fitted to them."""
MISFIT_BANDS = (0.12, 0.25, 0.5)
"""Bands about the position of k in which the slope of the residual is computed, as fractions of
half of the travel. The widest has enough samples in a single stroke."""
MISFIT_NOISE = 4.0
"""The square of this slope counts beyond this multiple of its variance. A clean record exceeds it
in one of 20 cases for each band, and then by little."""
LEAST_PART = 0.005
"""Smallest force of an extension of the model, as a fraction of the force (root mean squares). A
smaller part changes k by less than its usual interval, and may be an error of the smoothing."""
KNOTS = 17
"""Number of positions that are tried for a knot, before the position is refined."""
LARGEST_KNOT = 0.8
"""Largest distance of these positions from the middle, as a fraction of half of the travel."""
FRICTION_SLIPS, LONGEST_SLIP = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16), 0.25
"""Slips of the friction that are tried, and the longest slip, as fractions of half of the travel.
With a longer slip, friction and stiffness are hardly distinguished."""
FRICTION_EXPLAINS = 0.6
"""Largest residual beyond the noise with friction, relative to that without it. Friction leaves
less than 0.3 of it; a gap before the specimen that looks like friction leaves 0.7."""
FRICTION_FORM_ERROR = 0.05
"""Standard deviation of the force of the friction, as a fraction of it, because its form is not
known: Dahl's model gives 7 % more than the force of an elastoplastic element."""
LEAST_SPEED_CHANGE = 0.15
"""Smallest standard deviation of the speed over the path, relative to its mean, with which friction
and damping are separated. It is 0.28 in a sine, and below 0.1 in a triangle wave."""
LARGEST_REST_SHARE = 0.05
"""Largest share of the time in contact at less than a tenth of the mean speed with which friction
and damping are not separated. In a rest, the friction remains."""
LEAST_SLIP_NOISE = 4.0
"""Smallest slip, in standard deviations of the noise of the smoothed position."""
NOTABLE_STIFFENING = 0.05
"""Change of the stiffness over the middle half of the travel, relative to the stiffness, above
which it is stated that the stiffness depends on depth."""
NOTABLE_FORM = 0.005
"""Change of k by the form of a lag, relative to k, above which a remark states it."""
NOTABLE_CHANGE = 0.02
"""Relative difference of k from that of the Kelvin-Voigt model above which a knot, mass, friction
or damping that depends on depth is stated even if the residual of Kelvin-Voigt is small."""
MOST_LAYER_DEGREE = 2
"""Largest degree of the polynomial of a model with a knot that describes two layers."""
LARGEST_LAYER_RATIO = 50.0
"""Ratio of the stiffnesses after and before a knot above which the motion before the knot counts as
motion out of contact."""
FLAT_LAYER_RATIO = 10.0
"""Smallest ratio of the stiffness after a knot to that before it with which a nearly constant force
before the knot counts as that out of contact."""
LEAST_LAYER_RATIO = 1.3
"""Smallest ratio of the stiffness of two layers. A smaller change is that of a single body whose
stiffness depends on depth."""
FEWEST_LOCK_IN = 3
"""Smallest number of blocks of whole cycles from which the complex stiffness is computed."""
SHORTEST_LOCK_IN = 3
"""Smallest number of cycles of a block. The spectrum of a Hann window is zero from two bins on."""
MOST_LOCK_IN = 10
"""Approximate largest number of these blocks. The quantile of their scatter is then 2.3."""
CONTRADICTION_NOISE = 1.5
"""Least residual of the best model, in standard deviations of the noise of the smoothed force, for
which the batch models are compared with it. Below it, no model can be clearly better."""
FRICTION_RESIDUAL = 0.5
"""Friction is reported if the residual with Coulomb friction is less than this fraction of the
residual of the best candidate."""
SAME_TIME_RATIO = 1.5
"""Ratio of two time constants below which they are reported as one."""

# Records without a stiffness, or with a remark

FEWEST_SAMPLES_PER_CYCLE = 12.0
"""Smallest number of samples per cycle of the motion that is sufficient with smoothing. Below it,
the third differences of a sine, from which the noise is estimated, exceed 3 % of its amplitude."""
PUNCTURE_FALL = 0.25
"""Smallest fall of the force in loading that counts as a puncture, as a fraction of its range."""
PUNCTURE_NOISE = 12.0
"""Smallest fall of the force that counts as a puncture, in standard deviations of its noise."""
PUNCTURE_TRAVEL = 0.02
"""Largest travel during a puncture, as a fraction of the travel of the record."""
PUNCTURE_TIME = 0.1
"""Longest duration of a puncture, as a fraction of the duration of the loading: a relaxation takes
longer."""
SHORTEST_CREEP = 0.3
"""Shortest time at a constant force in a creep test, as a fraction of the record."""
LEAST_CREEP = 0.1
"""Smallest travel at the constant force of a creep test, as a fraction of the travel of the
record."""
LARGEST_ZERO_FORCE = 0.1
"""Largest magnitude of the highest force that counts as zero, as a fraction of the force range."""
OUT_OF_CONTACT_TRAVEL = 0.05
"""Fraction of the travel, from the lowest position, that is assumed to be out of contact."""
CONSTANT_FREE_FORCE = 0.02
"""Largest standard deviation of the force out of contact, as a fraction of the force range."""
SLOW_ADHESION_NOISE = 5.0
"""Smallest adhesion force, in standard deviations of the smoothed force out of contact: the noise
of the force can be slow."""
LARGEST_PULL_NOISE = 0.02
"""Standard deviation of the noise of the mean of samples that is accepted for the adhesion force,
as a fraction of it."""
LEAST_ADHESION = 0.015
"""Smallest adhesion that is reported, as a fraction of the force range."""
ADHESION_NOISE = 6.0
"""Smallest adhesion that is reported, in standard deviations of the noise of the smoothed force."""
LARGEST_STOP_TRAVEL = 10.0
"""Largest travel of a position that rests, in standard deviations of its noise."""
LEAST_STOP_FORCE = 30.0
"""Smallest change of the force that is not noise, while the position rests, in standard deviations
of the noise of the smoothed force."""
WIDEST_INTERVAL = 0.5
"""If the half width of the 95 % interval of k is larger than this fraction of k, k is not
identifiable."""
WITHOUT_MEANING = 10.0
"""Multiple of k, and of the ratio of force to travel, above which a half width is not printed."""
LEAST_CONTACT_MOTION = 10.0
"""Smallest travel in contact with which k is fitted, in units of 2.5 standard deviations of the
noise of the position."""
LEAST_DEPTH = 0.02
"""Smallest travel in contact with which k is fitted, as a fraction of the travel of the record."""
BAD_FIT_R2 = 0.9
"""If R^2 of the best model is below this limit, a remark on the bad fit is made."""
DRIFT_OF_RESIDUAL = 0.7
"""Smallest part of the variance of the residual of a bad fit that is that of a line in time, with
which a drift is named as its cause."""
NEAR_POSITION, SINGLE_SPEED = 0.1, 0.1
"""Distance from the position of k, as a fraction of the travel in contact, within which the speeds
are compared, and their largest relative standard deviation that counts as one speed."""
NO_RESULT_R2 = 0.8
"""If R^2 of the best model is below this limit, no stiffness is reported, provided that the record
contains free motion or the misfit is structural (`STRUCTURAL_DEGREE`)."""
STRUCTURAL_DEGREE = 4
"""If the best polynomial has at least this degree, a bad fit is attributed to the structure of the
model (structural misfit). With a lower degree, it is attributed to noise."""
CONSTANT_SPEED = 1e-9
"""If the standard deviation of the velocity is below this fraction of the mean speed, the speed
counts as constant."""
SPEED_DEGREE, FREE_SPEED = 5, 0.1
"""Degree of a polynomial of the depth, and largest residual of the speed about it, as a fraction of
the speed, with which damping cannot be separated from a stiffness that depends on depth."""
SUFFICIENT_RESIDUAL = 0.02
"""If the residual of the Kelvin-Voigt model is below this fraction of the typical force, the model
is sufficient. The typical force is 0.35 times the force range, which is the root mean square of a
sine."""
BASELINE_PERCENTILES = (2.0, 98.0)
"""Percentiles of the baseline whose difference is its size. The cosines are uncertain at the two
ends of the record, where a coarse position changes them by 20 % of the force range."""
SMALL_BASELINE = 0.05
"""Size of the baseline below which no remark on it is made, as a fraction of the force
range. The baseline is the part of the force that is slower than the palpation."""
FEWEST_INDEPENDENT = 35
"""Number of independent samples that the intervals need. If there are fewer, a remark says so.

With fewer samples, the error model for four parameters has fewer than four cosines
(`robust_error`).
"""
SHORTEST_RELAXATION_HOLD = 0.5
"""Shortest hold in contact [s] in which a relaxation of the force can be distinguished from lost
motion (backlash). Both have a similar effect on the force in a motion without such a hold."""
REST_SPEED = 0.02
"""Largest speed at rest, relative to the 95 % quantile of the speed."""
LEAVING_SPEED = 0.2
"""Smoothed speed at which a tip that rested behind lost motion moves again, relative to the 95 %
quantile of the speed. In a sine it begins to move with 0.28 to 0.47 of the largest speed, for a
lost motion of 2 to 6 % of the amplitude, and half of it is reached in the middle of the kernel."""
UNUSED_REST = 0.2
"""Part of a rest that is not used, at its start and at its end, as a fraction of the rest."""
SHORTEST_REST = 0.03
"""Shortest used part of a rest, as a fraction of the record."""
LEAST_DRIFT = 0.01
"""Smallest rise of the force at rest that counts as a drift, as a fraction of the force range."""
DRIFT_NOISE = 6.0
"""Smallest rise of the force that counts as a drift, in standard deviations of the noise of the
smoothed force."""
STIFFEST_AT_REST = 3.0
"""Assumed largest stiffness at the position of a rest, divided by the mean stiffness."""
FEWEST_COMPARED_CYCLES = 6
"""Smallest number of cycles to detect a change of the stiffness."""
FEWEST_CYCLE_SAMPLES = 8
"""Smallest number of samples in a cycle that is compared."""
TREMOR_TRAVEL = 0.25
"""Least travel of a cycle, relative to the largest travel of a cycle. A smaller cycle is tremor."""
LEAST_CHANGE = 0.1
"""Smallest relative change of the stiffness that is reported. In 260 records of 13 kinds with a
constant stiffness, limits of 0.08 and 0.15 give the same number of false alarms (none)."""
CONSTANT_RESIDUAL = 1.3
"""Largest residual of a law that does not change over time, in standard deviations of the noise of
the smoothed force, with which cycles of different stiffness are those of different depth."""
DEPTH_EXPLAINS = 0.8
"""Smallest share of the variance of the stiffness of the cycles that a dependence on the depth of
the cycle explains."""
CUMULATIVE_RANGE = 2.0
"""Smallest significant range of the cumulative sum of the slopes of the cycles, in standard
deviations of a slope times the square root of the number of cycles. For independent slopes, one of
100 records exceeds it (Kuiper's distribution); the other limits of a change make false alarms
rarer."""
FEWEST_DEVIATING_CYCLES = 3
"""Smallest number of cycles with another stiffness that is reported. The median of three is not
changed by one cycle with a wrong slope, such as an incomplete first cycle."""
CHANGE_SCATTER = 5.0
"""Smallest change of the stiffness that is reported, in standard errors."""
FREQUENCY_CHANGE = 1.5
"""If the ratio of the frequencies of the first and last cycles is larger, a change of the stiffness
is attributed to the frequency."""
FEWEST_SLOPE_CYCLE_SAMPLES = 14
"""Smallest number of samples of a cycle in which a slope at a force is computed."""
FEWEST_SLOPE_CYCLES = 3
"""Smallest number of cycles that contain the force at which k is stated."""
INNER_FORCE = 0.1
"""Part of the force range of a cycle, at each end, in which no slope is computed."""
LEAST_SLOPE_DIFFERENCE = 0.05
"""Smallest relative difference of k from the median slope of the cycles at which k is not
reported. In records with a linear, stiffening or relaxing body, the difference is below 0.03."""
LARGEST_DIFFERENCE = 0.12
"""Largest relative difference of k from the median slope of the cycles that widens the interval of
k. With a larger difference, k is not reported."""
LARGEST_SLOPE_SCATTER = 0.05
"""Largest relative standard deviation of the slopes of the cycles of a linear body whose surface
moves. None of 40 records in which only the position drifts exceeds it."""
EXPLAINED_RESIDUAL = 2.0
"""Largest residual of a model, in standard deviations of the noise of the smoothed force, with
which k is that of the model although the slopes of the cycles differ."""
POINT_DISTANCE = 0.02
"""Largest distance of the record from the point at which k is stated, as a fraction of the ranges
of position and force."""
FEWEST_LAG_CYCLES = 4
"""Smallest number of whole cycles from which a drift of the lag is found."""
LAG_PERIOD_CHANGE = 1.2
"""If the ratio of the periods of the first and last cycles is larger, a change of the phase may be
caused by the frequency, and no drift of the lag is sought."""
LEAST_PHASE_DRIFT = 0.007
"""Smallest change of the phase between force and position over the record that is reported [rad].
It changes the loss factor by half of this value."""
LAG_SCATTER = 8.0
"""Smallest drift of the phase that is reported, in standard errors."""
LAG_PROBABILITY = 0.998
"""Smallest probability that a drift of the phase is not due to chance (Student's t)."""
LINEAR_LAG = 0.9
"""Smallest share of the variance of the phase that a linear drift explains."""
LARGEST_GROWTH = 0.5
"""Largest relative change of the magnitude of the stiffness during a drift of the lag, as a
multiple of the change of the phase."""
LARGEST_PHASE_DRIFT = 0.5
"""If the phase drifts by more [rad], k is not reported either: its error can exceed 2 %."""
CREEP_NOISE = 3.0
"""Smallest motion in the last quarter of a creep, in standard deviations of the noise of the
position."""
LOADING_SPEED = 0.02
"""Smallest speed of a loading in which a puncture is sought, as a fraction of the typical speed."""
BETTER_BIC = 10.0
"""Smallest difference of the BIC with which another model is better than Kelvin-Voigt: very strong
evidence (Kass and Raftery, J. American Statistical Association 90, 1995)."""
BETTER_RESIDUAL = 1.05
"""Smallest ratio of the residuals with which another model is better than Kelvin-Voigt."""

VISCOUS_SHARE = 0.2
"""Largest stiffness, with its error, of a viscous body, relative to its damping divided by the time
of the motion."""

# Lost motion without a calibration

FEWEST_LOST_MOTION_SAMPLES = 30
"""Smallest number of independent samples in contact with which lost motion is sought."""
LEAST_LOST_MOTION = 3e-6
"""Smallest half width of a lost motion that is reported [m]: of the size of the run-out and the
interpolation error of usual encoders."""
LEAST_LOST_MOTION_COUNTS = 8.0
"""Smallest half width of a lost motion that is reported, as a multiple of the resolution of the
position: the rounding of the position is a hysteresis of half a step."""
LEAST_LOST_MOTION_SHARE = 0.01
"""Smallest half width of a lost motion that is reported, as a fraction of the amplitude: it changes
tan delta by 0.013, and relaxation that no model describes exactly can look like less."""
WIDEST_LOST_MOTION = 0.7
"""Largest half width of a lost motion that is sought, as a fraction of the amplitude."""
LOST_MOTION_BIC = 10.0
"""Smallest difference of the information criterion with which lost motion is reported."""
LOST_MOTION_LAG_ERROR = 0.03
"""Error of the half width if the lag of the force is not known, as a fraction of it. On the default
rig, whose lag is 2.7 ms, the half width is 1 to 2.4 % too small without the lag."""
LOST_MOTION_RESIDUAL = 0.6
"""Largest residual beyond the noise, relative to that without lost motion. Lost motion leaves less
than 0.45 of it in most records. A relaxation that no model describes leaves 0.7 to 0.9."""
NOISE_MARGIN = 1.05
"""Factor on the noise of the force, for the error of its estimate."""
LOST_MOTION_PREDICTION = 0.1
"""Smallest decrease of the logarithm of the prediction error with which lost motion is reported.
Where noise limits the decrease, half of the decrease for the fitted samples is sufficient."""
LEAST_AMPLITUDE_FOR_K, LEAST_AMPLITUDE_FOR_B = 2.0, 5.0
"""Smallest amplitude in contact with which k, or b, is determined, divided by the half width of a
lost motion that is not calibrated."""
UNCERTAIN_CORRECTION = 0.35
"""Part of the correction for a lost motion without calibration that widens the intervals.

Friction that builds up gradually (Dahl's model) is corrected only in part: by 65 to 100 % of the
error of b in most records.
"""

NOTABLE_INERTIA = 0.005
"""Smallest decrease of k by 100 g beyond the force sensor that is a remark, as a fraction of k."""

NOTABLE_LAG = 0.01
"""Smallest decrease of b by 1 ms of lag of the force that is a remark, as a fraction of b. Usual
force sensors lag by 0.5 to 5 ms."""
LARGEST_LAG_EFFECT = 0.5
"""Largest decrease of b by 1 ms of lag of the force, as a fraction of b, with which b can be used
although the lag is not known. A usual lag then changes b by more than its value."""

# A gap where the stiffness is stated

GAP_PARTS = 24
"""Number of parts of the travel in which the slope of the force is computed."""
FEWEST_GAP_LOADINGS = 2
"""Smallest number of loadings over most of the travel."""
GAP_NEAR = 3
"""Largest distance of a gap from the point of k [parts]."""
LEAST_GAP_DIP, GAP_SCATTER = 0.06, 6.0
"""Smallest decrease of the slope in a gap, as a fraction of the slopes on both sides, and in
standard deviations of these. In a gap, the damping of the specimen moves the tip slowly, so that
the force also changes there."""
GAP_SIDE, GAP_SIDE_CHANGE = 4, 0.05
"""Smallest number of parts on each side of a gap whose slope is within this fraction of the median
slope of the side."""

# Contact point that moves

FEWEST_PRESSES, MOST_KNOTS = 2, 20
"""Smallest number of presses with which a motion of the contact point is sought, and largest number
of positions that are fitted. With more presses, several have the same position."""
SHARE_OF_ROWS = 0.25
"""Largest number of these positions, as a fraction of the number of independent samples."""
MOST_REVERSALS = 1.5
"""Largest sum of all changes of the position, divided by their range, if it changes in a press."""
MOVED_BIC = 10.0
"""Smallest difference of the information criterion with which the motion is reported."""
MOVED_RESIDUAL = 0.6
"""Largest residual beyond the noise, relative to that with a contact point that rests."""
NEGLIGIBLE_MISFIT = 0.6
"""Largest residual beyond the noise, relative to that of the smoothed force, with which the motion
is possible although relaxation describes the force as well."""
MOTION_FORM_ERROR = 0.005
"""Relative standard deviation of b because the form of the motion is not known. In 14 records of
surfaces that recede exponentially, the error is 0.2 % (median), at most 0.9 %."""
LEAST_MOVED_SHARE, LARGEST_MOVED_SHARE, MOVED_ERRORS = 0.002, 0.6, 6.0
"""Smallest and largest range of the motion, as a fraction of the travel in contact, and smallest
range in standard errors."""

# Cycles of a short record

FEWEST_TREND_CYCLES, TREND_PROBABILITY = 4, 0.999
"""Smallest number of cycles in which a trend of the stiffness is sought, and smallest probability
that it is not due to chance (Student's t)."""
PAIR_CHANGE, CHANGE_ERRORS = 0.25, 8.0
"""Smallest relative change with which two equal cycles are sufficient, and smallest change in
standard deviations of the slope of a cycle."""
SAME_STIFFNESS, FEWEST_SAME_CYCLES = 0.015, 3
"""Largest relative difference of cycles with the same stiffness, and their smallest number."""
FEWEST_ISOLATED_CYCLES = 2
"""Smallest number of successive cycles that differ from the cycles with the same stiffness."""
SINGLE_SHARE = 0.15
"""Smallest share of all cycles at which a single cycle that differs by far is a change."""
SAME_TRAVEL, EQUAL_TRAVEL = 0.1, 0.03
"""Largest relative differences of the travel of many and of few compared cycles: the stiffness of a
nonlinear body depends on the travel."""
CUBIC_PHASE = 0.3
"""Largest part of a third harmonic across the phase of the cube of the position, for an elastic
force; damping adds such a part."""
