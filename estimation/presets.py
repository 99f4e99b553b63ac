"""Settings of a bank: the paper's own, and settings scaled to the data."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from estimation.bank import Bank
from estimation.checks import checked_samples
from estimation.estimator import Estimator
from estimation.gate import Gate, GateSettings
from estimation.methods.active_observer import ActiveObserver
from estimation.methods.adaptive_identification import AdaptiveIdentification
from estimation.methods.batch_window import BatchWindow
from estimation.methods.coarse_to_fine import CoarseToFine
from estimation.methods.composite_adaptive import CompositeAdaptive
from estimation.methods.conditional_update import ConditionalUpdate
from estimation.methods.constant_trace import ConstantTrace
from estimation.methods.directional_forgetting import DirectionalForgetting
from estimation.methods.grid import Axis, Grid
from estimation.methods.hunt_crossley_double_stage import DoubleStage
from estimation.methods.hunt_crossley_logarithmic import Logarithmic
from estimation.methods.indirect_adaptive import IndirectAdaptive
from estimation.methods.kalman_filter import RandomWalkKalman, process_noise
from estimation.methods.multi_estimator import MultiEstimator
from estimation.methods.normalised_identification import NormalisedIdentification
from estimation.methods.passive_least_squares import PassiveLeastSquares
from estimation.methods.pooled_segments import PooledSegments
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.methods.reference_model import ReferenceModel
from estimation.methods.spectral import SpectralRatio
from estimation.methods.subspace_forgetting import SubspaceForgetting
from estimation.methods.switching import SwitchingMultiEstimator
from estimation.model import KELVIN_VOIGT, Model

PAPER = ("rls", "ai", "me")
"""The paper's estimators."""


LONGEST = 1e3
"""Longest memory [s] of methods other than the paper's."""
GATE = GateSettings(force=0.1, speed=2e-3, window=0.02)
"""For palpation by hand."""


@dataclass(frozen=True)
class Preset:
    """Settings of a bank, from which every method has its own.

    `dataclasses.replace(preset, forgetting=0.95)` changes one. The units and ranges are those
    of the estimators' parameters of the same names.
    """

    forgetting: float
    sample_period: float
    initial_covariance: tuple[float, float]
    adaptation_gain: tuple[float, float]
    ai_method: Literal["rk4", "exact"]
    grid: Grid
    forgetting_rate: float
    x_size: float = 5e-3
    """Typical displacement [m]."""
    v_size: float = 25e-3
    """Typical velocity [m/s]."""
    f_size: float = 10.0
    """Typical force [N]."""
    segment: float = 0.5
    """Length of the segments that are compared for misfit [s], about a period of the motion."""
    gate: GateSettings | None = GATE
    """Where estimates hold, but for the paper's; None for nowhere."""
    correlation: float = 1.0
    """Samples for each one whose noise is independent, as the conditioner tells it."""
    model: Model = KELVIN_VOIGT
    """Model of the methods that take any regressors."""
    estimators: tuple[str, ...] = PAPER
    """Names of the estimators, out of `METHODS`."""

    @property
    def memory(self) -> float:
        """Time [s] in which the weight of a sample falls to 1/e, `LONGEST` at the most."""
        if self.forgetting == 1.0:
            return LONGEST
        return min(-self.sample_period / math.log(self.forgetting), LONGEST)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Typical size of each of the model's regressors."""
        return self.model.sizes(self.x_size, self.v_size, self.f_size)

    @property
    def covariance(self) -> tuple[float, ...]:
        """Diagonal of P0 of methods that are not the paper's, per N^2 of force variance."""
        return tuple(1e4 / size**2 for size in self.sizes)

    def bank(self) -> Bank:
        """A fresh bank with these settings.

        Raises
        ------
        ValueError
            A setting is out of its range, or a name is none of `METHODS`.
        """
        made = {}
        for name in named_estimators(self.estimators):
            try:
                made[name] = METHODS[name](self)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from error
        if self.model.further and not any(e.model.further for e in made.values()):
            raise ValueError(f"model {self.model.name}: none of {', '.join(made)} takes it")
        return Bank(made, Gate(self.gate) if self.gate else None)


def rls(preset: Preset) -> Estimator:
    """The paper's; the model's further parameters start from a variance of their size."""
    return RecursiveLeastSquares(
        preset.forgetting,
        (*preset.initial_covariance, *preset.covariance[2:]),
        preset.sample_period,
        preset.model,
        preset.correlation,
        guess_variance=preset.covariance,
    )


def ai(preset: Preset) -> Estimator:
    """The paper's; the model's further parameters adapt within the memory."""
    further = (4.0 / (preset.memory * size**2) for size in preset.sizes[2:])
    return AdaptiveIdentification(
        (*preset.adaptation_gain, *further), preset.ai_method, preset.model, preset.correlation
    )


def ceiling(preset: Preset) -> tuple[float, ...]:
    """Largest variances of a Kalman filter, per N^2 of force variance."""
    return tuple(1.0 / size**2 for size in preset.sizes)


METHODS: dict[str, Callable[[Preset], Estimator]] = {
    "rls": rls,
    "ai": ai,
    "me": lambda p: MultiEstimator(p.grid, p.forgetting_rate, p.correlation),
    "rls_conditional": lambda p: ConditionalUpdate(
        p.forgetting**2, p.covariance, p.sample_period, 1.5, p.model, p.correlation
    ),
    "rls_directional": lambda p: DirectionalForgetting(
        p.forgetting, p.covariance, p.sample_period, p.model, p.correlation
    ),
    "rls_sift": lambda p: SubspaceForgetting(
        p.forgetting, p.covariance, p.sample_period, 1.0, p.model, p.correlation
    ),
    "rls_trace": lambda p: ConstantTrace(
        2.2e-4 * p.model.regressors * (1.0 - p.forgetting),
        p.covariance,
        model=p.model,
        correlation=p.correlation,
    ),
    "kalman": lambda p: RandomWalkKalman(
        process_noise(p.memory, p.sample_period, p.sizes),
        p.covariance,
        ceiling(p),
        p.model,
        p.correlation,
    ),
    "observer": lambda p: ActiveObserver(
        (
            *process_noise(p.memory, p.sample_period, p.sizes),
            *process_noise(0.1 * p.memory, p.sample_period, (1.0,)),
        ),
        (*p.covariance, 1e4),
        (*ceiling(p), 1.0),
        p.model,
        p.correlation,
    ),
    "passive": lambda p: PassiveLeastSquares(
        p.forgetting**1.25, p.covariance, p.sample_period, p.model, p.correlation
    ),
    "window": lambda p: BatchWindow(2.0 * p.memory, p.sample_period, p.model, p.correlation),
    "ai_normalised": lambda p: NormalisedIdentification(
        0.55 / p.memory, p.sizes, p.memory, p.model, p.correlation
    ),
    "indirect": lambda p: IndirectAdaptive(
        1.35 / p.memory, p.sizes, model=p.model, correlation=p.correlation
    ),
    "reference": lambda p: ReferenceModel(1.25 / p.memory, p.sizes, 10.0 / p.memory, model=p.model),
    "composite": lambda p: CompositeAdaptive(
        2.0 / p.memory, p.sizes, 5.0 / p.memory, model=p.model
    ),
    "spectral": lambda p: SpectralRatio(motion=max(0.02 * p.x_size, 1e-9)),
    "hc_double": lambda p: DoubleStage(p.memory, p.x_size, p.v_size, 0.003 * p.f_size),
    "hc_log": lambda p: Logarithmic(
        0.3 * p.memory, p.x_size, p.v_size, 0.003 * p.f_size, p.correlation
    ),
    "me_switching": lambda p: SwitchingMultiEstimator(
        p.grid,
        1.5 * p.forgetting_rate,
        hysteresis=0.05,
        dwell=0.25 * p.memory,
        correlation=p.correlation,
    ),
    "me_moving": lambda p: CoarseToFine(
        1.25 * p.forgetting_rate,
        patience=0.5 * p.memory,
        spacing=(p.f_size / p.v_size / 40.0, p.f_size / p.x_size / 4.0),
        correlation=p.correlation,
    ),
    "segments": lambda p: PooledSegments(p.segment, p.correlation),
}
"""Every method by name, made with the settings of a preset."""


def named_estimators(names: str | Sequence[str]) -> tuple[str, ...]:
    """Names of `METHODS`, in a sequence or with commas between; `all` stands for all of them.

    Raises
    ------
    ValueError
        A name is unknown or there twice, or there is none.
    """
    if isinstance(names, str):
        names = [name.strip() for name in names.split(",") if name.strip()]
    if list(names) == ["all"]:
        return tuple(METHODS)
    for name in names:
        if name not in METHODS:
            raise ValueError(f"estimator {name!r}: expected all, or some of {', '.join(METHODS)}")
        if list(names).count(name) > 1:
            raise ValueError(f"estimator {name!r} is named twice")
    if not names:
        raise ValueError(f"no estimator is named: expected all, or some of {', '.join(METHODS)}")
    return tuple(names)


def paper_preset(cube: str = "soft") -> Preset:
    """The paper's settings: (17), (18) for this cube, (19), beta = 0.98 at 1 kHz, lambda = 10.

    What the paper does not have is the same for all cubes.

    Raises
    ------
    ValueError
        The cube is not soft, medium or hard.
    """
    gains = {"soft": (2000.0, 1.2e5), "medium": (5000.0, 5.0e5), "hard": (50000.0, 1.0e7)}
    if cube not in gains:
        raise ValueError(f"cube must be one of {', '.join(gains)}, got {cube!r}")
    return Preset(
        forgetting=0.98,
        sample_period=1e-3,
        initial_covariance=(100.0, 100.0),
        adaptation_gain=gains[cube],
        ai_method="rk4",
        grid=Grid(b=Axis(-500.0, 500.0, 41), k=Axis(1500.0, 39900.0, 193)),
        forgetting_rate=10.0,
    )


def scaled_preset(x: ArrayLike, v: ArrayLike, f: ArrayLike, dt: ArrayLike) -> Preset:
    """Settings for data of any size and speed, scaled from the data itself.

    The memory is half a period of the motion's dominant oscillation, the shortest that shows
    damping and stiffness apart. The multi-estimator gets 10^8 candidates, to three times the
    stiffness and damping that would explain the whole force alone. Samples count while force
    and speed are above a fiftieth of their root mean squares.

    Parameters
    ----------
    x, v, f
        Displacement [m], velocity [m/s], force [N], each of shape (n,).
    dt
        Time since the sample before [s], of shape (n,), or one number for all.

    Raises
    ------
    ValueError
        As `Estimator.run`; or there is no motion or no force.
    """
    phi, force, periods, _ = checked_samples(x, v, f, dt)
    signals = (phi[:, 1], phi[:, 0], force)
    x_rms, v_rms, f_rms = (math.sqrt(float(np.mean(s**2))) if len(s) else 0.0 for s in signals)
    for what, size in (("displacement", x_rms), ("velocity", v_rms), ("force", f_rms)):
        if size == 0.0:
            raise ValueError(f"nothing to estimate from: the {what} is zero throughout")
    if np.ptp(phi[:, 1]) == 0.0:
        raise ValueError("nothing to estimate from: the displacement is constant")
    b_scale, k_scale = f_rms / v_rms, f_rms / x_rms
    period = float(np.median(periods))
    memory = math.pi * float(np.std(phi[:, 1])) / v_rms
    return Preset(
        forgetting=math.exp(-period / memory),
        sample_period=period,
        initial_covariance=(1e4 / v_rms**2, 1e4 / x_rms**2),
        adaptation_gain=(4.0 / (memory * v_rms**2), 4.0 / (memory * x_rms**2)),
        ai_method="exact",
        grid=Grid(
            b=Axis(-3.0 * b_scale, 3.0 * b_scale, 10_001), k=Axis(0.0, 3.0 * k_scale, 10_001)
        ),
        forgetting_rate=0.5 / memory,
        x_size=x_rms,
        v_size=v_rms,
        f_size=f_rms,
        segment=2.0 * memory,
        gate=GateSettings(force=0.02 * f_rms, speed=0.02 * v_rms, window=0.2 * memory),
    )
