"""The estimators over a recording, or over any file with a position and a force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from estimation import (
    Bank,
    Estimates,
    Excitation,
    Fit,
    Preset,
    force_error,
    least_squares,
    paper_preset,
    scaled_preset,
)
from estimation.compiled import Floats
from teleop.choices import make_conditioner
from teleop.errors import InputError
from teleop.names import ConditioningName, PresetName
from teleop.recorder.schema import estimate_columns
from teleop.recording import Recording
from teleop.summary import summarise
from teleop.table import Signals, quantity

FROM_DATUM = ("displacement", "slave_position", "indentation", "depth")
"""Names of a position that is already measured from the contact datum."""
FEWEST = 10
"""Fewest moving samples that are evaluated."""
PAPER_BANDWIDTH = 20.0
"""Bandwidth of the conditioning for the paper's preset [Hz], that of `teleop run`."""


class Datum(NamedTuple):
    """Where displacement and force are zero, in the file's own coordinates."""

    x: float
    """[m]"""
    f: float
    """[N]"""
    source: str
    """How it was chosen."""


@dataclass(frozen=True)
class EstimateSettings:
    """How a recording is to be evaluated."""

    datum: str = "auto"
    """`auto`, `file`, `start`, `mean`, or a position and a force such as `1.5mm,20N`."""
    preset: PresetName | Preset = "scaled"
    """Settings of the estimators: scaled from the data, the paper's, or given."""
    cube: str = "soft"
    """The cube whose adaptation gain the paper's preset takes."""
    conditioning: ConditioningName = "matched"
    bandwidth: float | None = None
    """Bandwidth of the conditioning [Hz]; None for ten times the dominant frequency."""
    force_lag: float = 0.0
    """Lag of the force channel that matched conditioning makes up for [s]."""
    whole: bool = False
    """Whether to take in rest before and after the motion."""
    resolution: float | None = None
    """Position of one encoder count [m]; None for the smallest step in the data."""


@dataclass(frozen=True)
class Evaluation:
    """The estimators' answer to a recording; arrays of shape (n,)."""

    t: Floats
    x: Floats
    v: Floats
    f: Floats
    dt: Floats
    estimates: dict[str, Estimates]
    bank: Bank
    batch: Fit
    datum: Datum
    preset: Preset
    bandwidth: float
    rate: float
    """Median sampling rate [Hz]."""
    jitter: float
    """Largest deviation of a sample period from the median, as a share of it."""
    samples: int
    """Samples in the recording, rest included."""
    excitation: Floats
    """Excitation measure at the motion's dominant frequency."""

    def summary(self) -> dict[str, Any]:
        """What the recording comes to, as `teleop estimate --json` prints it."""
        estimates = {
            name: summarise(self.t, self.x, self.v, self.f, series, self.bank[name])._asdict()
            for name, series in self.estimates.items()
        }
        return {
            "samples": self.samples,
            "samples_used": len(self.t),
            "rate_hz": self.rate,
            "jitter": self.jitter,
            "longest_gap_s": float(np.max(self.dt)),
            "from_s": round(float(self.t[0]), 9) + 0.0,
            "to_s": float(self.t[-1]),
            "datum": {
                "position_m": self.datum.x,
                "force_n": self.datum.f,
                "source": self.datum.source,
            },
            "bandwidth_hz": self.bandwidth,
            "memory_s": 0.5 / self.preset.forgetting_rate,
            "excitation": {
                "mean": float(np.mean(self.excitation)),
                "last": float(self.excitation[-1]),
            },
            "estimates": estimates,
            "batch": {
                "b": self.batch.b,
                "k": self.batch.k,
                "e_f": force_error(self.batch.residual, np.zeros_like(self.batch.residual)),
                "one_step_rms": self.batch.rms,
            },
        }

    def columns(self) -> tuple[dict[str, Floats], dict[str, str]]:
        """Signals and estimates as columns with their units, for a file."""
        columns = {"Time": self.t, "Displacement": self.x, "Velocity": self.v, "Force": self.f}
        units = {"Time": "s", "Displacement": "m", "Velocity": "m/s", "Force": "N"}
        columns["Excitation"], units["Excitation"] = self.excitation, "-"
        series = (values for estimates in self.estimates.values() for values in estimates)
        for column, values in zip(estimate_columns(self.estimates), series, strict=True):
            columns[column.name], units[column.name] = values, column.unit
        return columns, units


def evaluate(signals: Signals, settings: EstimateSettings) -> Evaluation:
    """Take the datum off, condition the signals, and run the estimators over the motion.

    Raises
    ------
    InputError
        A setting is out of its range, or nothing moves.
    """
    if len(signals.t) < FEWEST:
        raise InputError(
            f"only {len(signals.t)} samples were given to the estimators: "
            f"expected at least {FEWEST}"
        )
    if np.ptp(signals.f) == 0.0:
        raise InputError("nothing to estimate from: the force is the same in every sample")
    datum = find_datum(signals, settings.datum)
    dt = signals.dt
    motion = slice(None) if settings.whole else moving_part(signals.x)
    if len(dt[motion]) < FEWEST:
        raise InputError(f"only {len(dt[motion])} samples move: expected at least {FEWEST}")
    frequency = dominant_frequency(signals.t[motion], signals.x[motion])
    bandwidth = settings.bandwidth
    if bandwidth is None:
        bandwidth = 10.0 * frequency if settings.preset == "scaled" else PAPER_BANDWIDTH
    count = settings.resolution or smallest_step(signals.x)
    conditioner = make_conditioner(settings.conditioning, bandwidth, count, settings.force_lag)
    x, v, f = conditioner.run(signals.x - datum.x, signals.f - datum.f, dt)
    t, x, v, f, dt = (signal[motion] for signal in (signals.t, x, v, f, dt))
    try:
        if isinstance(settings.preset, Preset):
            preset = settings.preset
        elif settings.preset == "paper":
            preset = paper_preset(settings.cube)
        else:
            preset = scaled_preset(x, v, f, dt)
    except ValueError as error:
        raise InputError(str(error)) from error
    bank = preset.bank()
    estimates = bank.run(x, v, f, dt)
    measure = Excitation(frequency, resolution=10.0 * count)
    excitation = [measure.update(*sample) for sample in zip(x, v, dt, strict=True)]
    period = float(np.median(dt))
    return Evaluation(
        t=t,
        x=x,
        v=v,
        f=f,
        dt=dt,
        estimates=estimates,
        bank=bank,
        batch=least_squares(x, v, f),
        datum=datum,
        preset=preset,
        bandwidth=bandwidth,
        rate=1.0 / period,
        jitter=float(np.max(np.abs(dt - period))) / period,
        samples=len(signals.t),
        excitation=np.array(excitation),
    )


def recorded_signals(recording: Recording) -> Signals:
    """What the estimators were given in a recorded trial, before conditioning."""
    r = recording.estimated()
    return Signals(
        r["time"], r["paired_position"], r["paired_force"], r["paired_dt"], "slave_position"
    )


def recorded_settings(recording: Recording) -> EstimateSettings:
    """The settings with which a recorded trial estimated; they give its estimates to the bit.

    Raises
    ------
    InputError
        The recording does not tell them.
    """
    from pydantic import TypeAdapter, ValidationError

    settings = recording.settings
    try:
        return EstimateSettings(
            datum="file",
            preset=TypeAdapter(Preset).validate_python(settings["preset"]),
            conditioning=settings["conditioning"],
            bandwidth=settings["bandwidth_hz"],
            force_lag=settings["force_lag_s"],
            whole=True,
            resolution=settings["encoder_resolution_m"],
        )
    except (KeyError, TypeError, ValidationError) as error:
        raise InputError(
            f"the recording does not tell the settings of its estimators: {error}"
        ) from error


def agrees(evaluation: Evaluation, recording: Recording) -> bool:
    """Whether the estimates are those that the trial computed online, to the bit."""
    online = recording.estimated().estimates()
    return list(online) == list(evaluation.estimates) and all(
        np.array_equal(ours, theirs)
        for name, estimates in evaluation.estimates.items()
        for ours, theirs in zip(estimates, online[name], strict=True)
    )


def find_datum(signals: Signals, wanted: str) -> Datum:
    """Where displacement and force are zero.

    `auto` is the file's own zero for a column named a displacement, an indentation or a
    depth, and the mean of the moving part otherwise, about which a preloaded specimen is
    linear.
    """
    if wanted == "auto":
        named = signals.position_name.lower() in FROM_DATUM
        wanted = "file" if named else "mean"
    if wanted == "file":
        return Datum(0.0, 0.0, "the file's own zero")
    if wanted == "start":
        return Datum(float(signals.x[0]), float(signals.f[0]), "the first sample")
    if wanted == "mean":
        motion = moving_part(signals.x)
        return Datum(
            float(signals.x[motion].mean()),
            float(signals.f[motion].mean()),
            "mean of the motion",
        )
    position, _, force = wanted.partition(",")
    x, f = quantity(position, "position"), quantity(force, "force")
    if x is None or f is None:
        raise InputError(
            f"datum {wanted!r}: expected auto, file, start, mean, or a position and a force "
            "with units such as 1.5mm,20N"
        )
    return Datum(x, f, "given")


def moving_part(x: Floats) -> slice:
    """The samples from the first to the last that leave the rest at either end.

    A position has left a rest when it is off by more than 2 % of the range that holds 98 %
    of the samples, which one glitch of the sensor does not stretch.
    """
    if np.ptp(x) == 0.0:
        raise InputError("nothing moves: the position is the same in every sample")
    band = 0.02 * float(np.subtract(*np.percentile(x, [99.0, 1.0])) or np.ptp(x))
    first = int(np.argmax(np.abs(x - x[0]) > band))
    last = len(x) - int(np.argmax(np.abs(x[::-1] - x[-1]) > band))
    return slice(max(first - 1, 0), min(last + 1, len(x))) if first < last else slice(None)


def dominant_frequency(t: Floats, x: Floats) -> float:
    """Frequency [Hz] of the largest peak of a motion's spectrum, a drift taken off."""
    even = np.linspace(t[0], t[-1], len(t))
    motion = np.interp(even, t, x)
    seconds = even - even.mean()
    drift = (seconds @ motion) / (seconds @ seconds) * seconds
    spectrum = np.abs(np.fft.rfft(motion - motion.mean() - drift))
    return (int(np.argmax(spectrum[1:])) + 1) / float(t[-1] - t[0])


def smallest_step(x: Floats) -> float:
    """Smallest change between positions [m], an encoder's count."""
    steps = np.abs(np.diff(x))
    return float(steps[steps > 0.0].min(initial=np.inf))
