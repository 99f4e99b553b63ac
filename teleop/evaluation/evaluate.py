"""Evaluate a recording, or any file with position and force, by estimators and by batch models."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from estimation import (
    Bank,
    Excitation,
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
from teleop.errors import InputError, as_input_error
from teleop.evaluation.batch.analysis import analyse
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
from teleop.evaluation.reading.samples import Samples
from teleop.evaluation.reading.sampling_gaps import closed_up
from teleop.evaluation.reading.signals import Signals
from teleop.evaluation.reading.smallest_step import smallest_step
from teleop.evaluation.settings import EstimateSettings

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

    The datum (the position and the force that are treated as zero) is subtracted. The signals are
    filtered. The estimators process the moving part of the record, in blocks of samples. All other
    results are computed from `samples.signals`, which contains only sections of a long record.

    After each gap (a time in which samples are missing), the filters start again, and samples are
    omitted until the filters have settled. The next sample that the estimators receive has a long
    sample period: the whole time since the last sample that they received. Therefore, the
    estimators reduce the weight of the old samples according to the true time that has passed.
    """
    lag, note = settings.force_lag, None
    if isinstance(samples, Signals):
        samples = Samples(samples)
    signals = samples.signals
    if lag is None:
        lag, (signals, note) = 0.0, without_filter_delay(signals)
        samples = Samples(signals) if samples.signals is not signals else samples
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
    motion = slice(None) if settings.whole else moving_part(signals.x)
    if len(signals.dt[motion]) < FEWEST_SAMPLES:
        raise InputError(
            f"only {len(signals.dt[motion])} samples move: expected at least {FEWEST_SAMPLES}"
        )
    with as_input_error():
        batch = within(signals, settings.averaged)
        analysis = analyse(batch, lag)
    datum = find_datum(signals, settings.datum, analysis.phases)
    band = analysis.record.band
    frequency = band.centre
    if band.coherence == 0.0:
        frequency = dominant_frequency(
            signals.x[motion], closed_up(signals.dt, signals.gaps)[motion]
        )
    bandwidth = settings.bandwidth
    if bandwidth is None:
        highest = band.high if band.coherence > 0.0 else frequency
        bandwidth = 10.0 * highest if settings.preset == "scaled" else BANDWIDTH
        bandwidth = min(bandwidth, 0.5 / float(np.median(signals.dt)))
    count = settings.resolution or smallest_step(signals.x)
    if settings.resolution and not RESOLUTIONS[0] <= count <= RESOLUTIONS[1]:
        raise InputError(
            f"resolution of the position {count:g} m: expected {RESOLUTIONS[0]:g} to "
            f"{RESOLUTIONS[1]:g} m"
        )
    given = settings.preset if isinstance(settings.preset, Preset) else None
    model = settings.model or (given.model if given else KELVIN_VOIGT)
    with as_input_error():
        conditioner = make_conditioner(settings.conditioning, bandwidth, count, lag, model)
    sampled = conditioned(conditioner, signals, datum, motion)
    regression = sampled.regression
    x, v, f, dt, further = regression
    with as_input_error():
        if given:
            preset = given
        else:
            paper = settings.preset == "paper"
            preset = paper_preset(settings.cube) if paper else scaled_preset(x, v, f, dt)
            preset = replace(preset, correlation=conditioner.correlation(float(np.median(dt))))
        preset = replace(preset, model=model, estimators=settings.estimators or preset.estimators)
        bank = preset.bank()
    fit = no_fit(len(x), len(model.further))
    if analysis.has_contact:
        fit = least_squares(x, v, f, further)
    period = float(np.median(dt))
    if given is None:
        bank = ContactBank(bank)
    online = OnlineRun(
        bank,
        Misfit(bank) if given else Misfit(bank, 1.0 / frequency),
        Excitation(frequency, resolution=10.0 * count),
        comparisons(bank, regression, fit),
        period,
        samples.count,
        max(1, math.ceil(samples.count * len(bank) / most)),
        write,
        settings.averaged,
    )
    gaps = []
    before = -math.inf
    begin, end = -math.inf, math.inf
    if samples.is_whole:
        start, stop, _ = motion.indices(samples.count)
        begin, end = signals.t[start], signals.t[stop - 1]
    stream = ConditionedBlocks(conditioner, datum, motion if samples.is_whole else slice(None))
    for block, recorded in samples.blocks():
        part = stream.add(block)
        if isinstance(bank, ContactBank):
            bank.contact = contact_at(analysis, part.t, part.regression.f + datum.f)
        online.add(part, recorded)
        times = np.concatenate([[before], block.t])
        gaps += [(float(times[i]), float(times[i + 1])) for i in block.gaps]
        before = float(block.t[-1])
    found = online.result()
    return Evaluation(
        online=found,
        sampled=sampled,
        bank=bank,
        least_squares=fit,
        datum=datum,
        preset=preset,
        bandwidth=bandwidth,
        rate=1.0 / period,
        jitter=found.largest_deviation / period,
        samples=samples.count,
        batch_samples=len(batch.t),
        in_sections=not samples.is_whole,
        analysis=analysis,
        filter_note=note,
        kept_force_variance=kept_variance(
            signals.f, regression.f, sampled.used, bandwidth * period
        ),
        gaps=tuple(gap for gap in gaps if gap[0] > -math.inf and begin < gap[1] <= end),
        averaged=settings.averaged,
    )


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
