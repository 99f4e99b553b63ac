"""Evaluate a recording, or any file with position and force, by estimators and by batch models."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from estimation import (
    Bank,
    ExpectedIntervals,
    Fit,
    Misfit,
    Preset,
    Regression,
    least_squares,
    paper_preset,
    scaled_preset,
)
from estimation.batch_fit import no_fit
from estimation.conditioning import BANDWIDTH, make_conditioner
from estimation.excitation import dominant_frequency
from estimation.model import KELVIN_VOIGT
from estimation.registry import PAPER
from estimation.transmission import stated_lag
from teleop.errors import InputError, as_input_error
from teleop.evaluation.batch.analysis import Analysis, analyse
from teleop.evaluation.evaluation import Evaluation
from teleop.evaluation.formats.units import SMALLEST
from teleop.evaluation.online.conditioned import (
    ConditionedBlocks,
    conditioned,
    kept_variance,
    within,
)
from teleop.evaluation.online.contact_bank import ContactBank, contact_at
from teleop.evaluation.online.datum import find_datum, moving_part
from teleop.evaluation.online.model_comparison import RunningComparison
from teleop.evaluation.online.run import OnlineRun, Table
from teleop.evaluation.online.thresholds import FEWEST_SAMPLES, RESOLUTIONS
from teleop.evaluation.reading.force_filter import without_filter_delay
from teleop.evaluation.reading.samples import Samples, SamplesAtTip
from teleop.evaluation.reading.signals import Signals, closed_up
from teleop.evaluation.reason import Reason
from teleop.evaluation.settings import EstimateSettings, known_lag, online_transmission

KEPT = 1 << 17
"""Value that the commands use for the parameter `most` of `evaluate`: largest number of estimates
that are kept, for all estimators together."""


def evaluate(
    samples: Samples | Signals,
    settings: EstimateSettings,
    most: float = math.inf,
    write: Callable[[Table], None] | None = None,
) -> Evaluation:
    """Evaluate a record: estimate k and b with the online estimators, and by batch evaluation.

    The online estimators process the moving part of the record, in blocks of samples. All other
    results are computed from `samples.signals`, which contains only sections of a long record.

    `most` limits the number of estimates in the result, for all estimators together: if the record
    has more samples, those at evenly spaced samples and at the last sample are kept. `write`
    receives the signals and estimates of each block: columns by name, and their units.

    Raises InputError if a setting is out of its range, if position or force is constant or hardly
    changes, or if too few samples move or remain between gaps.
    """
    transmission = settings.transmission
    samples, lag, filter_note = with_known_lag(samples, known_lag(settings))
    check_changes(samples.signals)
    at_tip = without_lost_motion(samples, transmission.lost_motion)
    online_known = online_transmission(settings)
    samples = without_lost_motion(samples, online_known.lost_motion)
    signals = samples.signals
    motion = slice(None) if settings.whole else moving_part(signals.x)
    if len(signals.dt[motion]) < FEWEST_SAMPLES:
        raise InputError(
            f"only {len(signals.dt[motion])} samples move: expected at least {FEWEST_SAMPLES}"
        )

    # The batch evaluation comes first: the online estimators get from it the datum, the bandwidth,
    # and the times without contact, in which they hold their estimates.
    batch, analysis = analysed(at_tip.signals, lag, settings)
    datum = find_datum(signals, settings.datum, analysis.phases)
    frequency, highest = motion_frequencies(analysis, signals, motion)
    bandwidth = settings.bandwidth
    if bandwidth is None:
        bandwidth = 10.0 * highest if settings.preset == "scaled" else BANDWIDTH
        bandwidth = min(bandwidth, 0.5 / float(np.median(signals.dt)))
    resolution = position_resolution(signals, settings.resolution)

    # Conditioning of `samples.signals`, for the scaled preset and the least-squares fit, which need
    # all samples at once.
    given = settings.preset if isinstance(settings.preset, Preset) else None
    model = settings.model or (given.model if given else KELVIN_VOIGT)
    with as_input_error():
        conditioner = make_conditioner(
            settings.conditioning,
            bandwidth,
            resolution,
            online_known.force_lag,
            model,
            delay_share=online_known.delay_share,
        )
    sampled = conditioned(conditioner, signals, datum, motion)
    regression = sampled.regression
    x, v, f, dt, further = regression
    period = float(np.median(dt))
    with as_input_error():
        if given:
            preset = given
        else:
            paper = settings.preset == "paper"
            preset = paper_preset(settings.cube) if paper else scaled_preset(x, v, f, dt)
            preset = replace(preset, correlation=conditioner.correlation(period))
        preset = replace(preset, model=model, estimators=settings.estimators or preset.estimators)
        bank = preset.bank()
    fit = no_fit(len(x), len(model.further))
    if analysis.has_contact:
        fit = least_squares(x, v, f, further)
    # A recorded trial is replayed as it was estimated: without knowledge of later samples.
    if given is None:
        bank = ContactBank(bank)

    # The online estimators, over all samples of the record in blocks.
    run = OnlineRun(
        bank,
        Misfit(bank) if given else Misfit(bank, 1.0 / frequency),
        ExpectedIntervals(bandwidth),
        comparisons(bank, regression, fit),
        period,
        samples.count,
        max(1, math.ceil(samples.count * len(bank) / most)),
        write,
        settings.averaged,
    )
    if not samples.is_whole:  # the moving part is known for the sections only
        motion = slice(None)
    blocks = ConditionedBlocks(conditioner, datum, motion)
    gaps = []
    before = -math.inf
    for block, recorded in samples.blocks():
        part = blocks.add(block)
        if isinstance(bank, ContactBank):
            bank.contact = contact_at(analysis, part.t, part.regression.f + datum.f)
        run.add(part, recorded)
        times = np.concatenate([[before], block.t])
        gaps += [(float(times[i]), float(times[i + 1])) for i in block.gaps]
        before = float(block.t[-1])
    if samples.is_whole:
        start, stop, _ = motion.indices(samples.count)
        begin, end = signals.t[start], signals.t[stop - 1]
        gaps = [gap for gap in gaps if begin < gap[1] <= end]
    online = run.result()

    return Evaluation(
        online=online,
        sampled=sampled,
        bank=bank,
        least_squares=fit,
        datum=datum,
        preset=preset,
        bandwidth=bandwidth,
        rate=1.0 / period,
        jitter=online.largest_deviation / period,
        samples=samples.count,
        batch_samples=len(batch.t),
        in_sections=not samples.is_whole,
        analysis=analysis,
        filter_note=filter_note,
        kept_force_variance=kept_variance(
            signals.f, regression.f, sampled.used, bandwidth * period
        ),
        gaps=tuple(gap for gap in gaps if gap[0] > -math.inf),
        averaged=settings.averaged,
    )


def batch_analysis(signals: Signals, settings: EstimateSettings) -> Analysis:
    """Return the batch evaluation of a record, which `evaluate` contains; InputError as there."""
    samples, lag, _ = with_known_lag(signals, known_lag(settings))
    check_changes(samples.signals)
    at_tip = without_lost_motion(samples, settings.transmission.lost_motion)
    return analysed(at_tip.signals, lag, settings)[1]


def analysed(at_tip: Signals, lag: float, settings: EstimateSettings) -> tuple[Signals, Analysis]:
    """Return the analysed part of the signals without lost motion, and its batch evaluation."""
    known = settings.transmission
    with as_input_error():
        batch = within(at_tip, settings.averaged)
        return batch, analyse(batch, known if known.force_lag else stated_lag(known, lag))


def with_known_lag(
    samples: Samples | Signals, lag: float | None
) -> tuple[Samples, float, Reason | None]:
    """Return the samples, the lag of the force that is left in them [s], and a remark.

    If the settings state no lag, the delay of a force filter that the file states is compensated.
    """
    signals = samples if isinstance(samples, Signals) else samples.signals
    note = None
    if lag is None:
        lag, (signals, note) = 0.0, without_filter_delay(signals)
    if isinstance(samples, Signals) or samples.signals is not signals:
        samples = Samples(signals)
    return samples, lag, note


def without_lost_motion(samples: Samples, lost_motion: float) -> Samples:
    """Return the samples with the position behind lost motion of this half width [m]."""
    travel = float(np.ptp(samples.signals.x))
    if lost_motion and not 2.0 * lost_motion < travel:
        raise InputError(
            f"the motion is too small: travel {travel * 1e6:.4g} um, expected more than twice the "
            f"lost motion of {lost_motion * 1e6:.4g} um"
        )
    return SamplesAtTip(samples, lost_motion) if lost_motion else samples


def check_changes(signals: Signals) -> None:
    """Raise InputError if there are too few samples, or if position or force hardly changes."""
    if len(signals.t) < FEWEST_SAMPLES:
        raise InputError(
            f"the estimators received only {len(signals.t)} samples: "
            f"expected at least {FEWEST_SAMPLES}"
        )
    for quantity, values in (("position", signals.x), ("force", signals.f)):
        if 0.0 < np.ptp(values) < SMALLEST:
            raise InputError(
                f"the {quantity} changes by {np.ptp(values):g} in SI units: "
                f"expected more than {SMALLEST:g}"
            )
    if np.ptp(signals.f) == 0.0:
        raise InputError("nothing to estimate from: the force is the same in every sample")


def motion_frequencies(analysis: Analysis, signals: Signals, motion: slice) -> tuple[float, float]:
    """Return the central and the highest frequency at which the force follows the motion [Hz].

    Without such a band, both are the dominant frequency of the position.
    """
    band = analysis.record.band
    if band.coherence > 0.0:
        return band.centre, band.high
    periods = closed_up(signals.dt, signals.gaps)
    frequency = dominant_frequency(signals.x[motion], periods[motion])
    return frequency, frequency


def position_resolution(signals: Signals, given: float | None) -> float:
    """Return the resolution of the position [m]: the given one, or the smallest step."""
    if given and not RESOLUTIONS[0] <= given <= RESOLUTIONS[1]:
        raise InputError(
            f"resolution of the position {given:g} m: expected {RESOLUTIONS[0]:g} to "
            f"{RESOLUTIONS[1]:g} m"
        )
    return given or signals.step


def comparisons(bank: Bank, regression: Regression, fit: Fit) -> list[RunningComparison]:
    """Return objects that compare the estimates with a least-squares fit to the whole record.

    Each object compares the estimators of one model. The estimators of the Kelvin-Voigt model
    f = b v + k x are compared with a fit of this model. The other estimators are compared with
    `fit`. If there are no other estimators than those of the paper (`PAPER`), the result is empty.
    """
    if set(bank) <= set(PAPER):
        return []
    x, v, f, dt, _ = regression
    modelled = {name for name, e in bank.items() if e.model.further}
    plain = least_squares(x, v, f)
    return [
        RunningComparison(bank, names, dt, reference.b, reference.k)
        for reference, names in ((plain, set(bank) - modelled), (fit, modelled))
        if names
    ]
