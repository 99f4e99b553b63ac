"""Find an estimator by its name.

The estimators are those of this package, and those that other installed packages register with
entry points (lines in the metadata of a package that name one of its functions).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from estimation import tuning
from estimation.estimator import Estimator
from estimation.method_settings import MethodSettings
from estimation.methods.active_observer import ActiveObserver
from estimation.methods.adaptive_identification import AdaptiveIdentification
from estimation.methods.batch_window import BatchWindow
from estimation.methods.coarse_to_fine import CoarseToFine
from estimation.methods.composite_adaptive import CompositeAdaptive
from estimation.methods.conditional_update import ConditionalUpdate
from estimation.methods.constant_trace import ConstantTrace
from estimation.methods.directional_forgetting import DirectionalForgetting
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

GROUP = "teleop.estimators"
"""Name of the group of entry points with which other packages register estimators."""
PAPER = ("rls", "ai", "me")
"""Names of the paper's estimators: recursive least squares, adaptive identification and
multi-estimator."""
Factory = Callable[[MethodSettings], Estimator]
"""Function that constructs an estimator from settings."""


def rls(preset: MethodSettings) -> Estimator:
    """Construct the recursive least squares estimator (RLS) of the paper.

    The initial variances of b and k are `preset.initial_covariance`. If the model has other
    parameters, their initial variances are the elements of `preset.covariance` after the first two.
    """
    return RecursiveLeastSquares(
        preset.forgetting,
        (*preset.initial_covariance, *preset.covariance[2:]),
        preset.sample_period,
        preset.model,
        preset.correlation,
        guess_variance=preset.covariance,
    )


def ai(preset: MethodSettings) -> Estimator:
    """Construct the adaptive identification estimator (AI) of the paper.

    The gains of b and k are `preset.adaptation_gain`. If the model has other parameters, their
    gains are computed from `preset.memory` and from the typical magnitudes of their regressors.
    """
    further = (4.0 / (preset.memory * size**2) for size in preset.sizes[2:])
    return AdaptiveIdentification(
        (*preset.adaptation_gain, *further), preset.ai_method, preset.model, preset.correlation
    )


def ceiling(preset: MethodSettings) -> tuple[float, ...]:
    """Return the upper limit of the variance of each parameter in a Kalman filter.

    The filter computes its variances for force noise with a variance of 1 N^2. The limits are for
    the same noise.
    """
    return tuple(1.0 / size**2 for size in preset.sizes)


BUILT_IN: dict[str, Factory] = {
    "rls": rls,
    "ai": ai,
    "me": lambda p: MultiEstimator(p.grid, p.forgetting_rate, p.correlation),
    "rls_conditional": lambda p: ConditionalUpdate(
        p.forgetting**tuning.CONDITIONAL_FORGETTING,
        p.covariance,
        p.sample_period,
        tuning.CONDITIONAL_THRESHOLD,
        p.model,
        p.correlation,
    ),
    "rls_directional": lambda p: DirectionalForgetting(
        p.forgetting, p.covariance, p.sample_period, p.model, p.correlation
    ),
    "rls_sift": lambda p: SubspaceForgetting(
        p.forgetting, p.covariance, p.sample_period, 1.0, p.model, p.correlation
    ),
    "rls_trace": lambda p: ConstantTrace(
        tuning.TRACE * p.model.regressors * (1.0 - p.forgetting),
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
            *process_noise(tuning.OBSERVER_MEMORY * p.memory, p.sample_period, (1.0,)),
        ),
        (*p.covariance, 1e4),
        (*ceiling(p), 1.0),
        p.model,
        p.correlation,
    ),
    "passive": lambda p: PassiveLeastSquares(
        p.forgetting**tuning.PASSIVE_FORGETTING,
        p.covariance,
        p.sample_period,
        p.model,
        p.correlation,
    ),
    "window": lambda p: BatchWindow(
        tuning.WINDOW * p.memory, p.sample_period, p.model, p.correlation
    ),
    "ai_normalised": lambda p: NormalisedIdentification(
        tuning.NORMALISED_RATE / p.memory, p.sizes, p.memory, p.model, p.correlation
    ),
    "indirect": lambda p: IndirectAdaptive(
        tuning.INDIRECT_RATE / p.memory, p.sizes, model=p.model, correlation=p.correlation
    ),
    "reference": lambda p: ReferenceModel(
        tuning.REFERENCE_RATE / p.memory,
        p.sizes,
        tuning.REFERENCE_BANDWIDTH / p.memory,
        model=p.model,
    ),
    "composite": lambda p: CompositeAdaptive(
        tuning.COMPOSITE_FORGETTING / p.memory,
        p.sizes,
        tuning.COMPOSITE_BANDWIDTH / p.memory,
        model=p.model,
    ),
    "spectral": lambda p: SpectralRatio(motion=max(tuning.SPECTRAL_MOTION * p.x_size, 1e-9)),
    "hc_double": lambda p: DoubleStage(
        p.memory, p.x_size, p.v_size, tuning.CONTACT_FORCE * p.f_size
    ),
    "hc_log": lambda p: Logarithmic(
        tuning.LOGARITHMIC_MEMORY * p.memory,
        p.x_size,
        p.v_size,
        tuning.CONTACT_FORCE * p.f_size,
        p.correlation,
    ),
    "me_switching": lambda p: SwitchingMultiEstimator(
        p.grid,
        tuning.SWITCHING_FORGETTING * p.forgetting_rate,
        hysteresis=tuning.HYSTERESIS,
        dwell=tuning.DWELL * p.memory,
        correlation=p.correlation,
    ),
    "me_moving": lambda p: CoarseToFine(
        tuning.MOVING_FORGETTING * p.forgetting_rate,
        patience=tuning.PATIENCE * p.memory,
        spacing=(
            tuning.FIRST_SPACING_B * p.f_size / p.v_size,
            tuning.FIRST_SPACING_K * p.f_size / p.x_size,
        ),
        correlation=p.correlation,
    ),
    "segments": lambda p: PooledSegments(p.segment, p.correlation),
}
"""Functions that construct the estimators of this package, by the name of the estimator."""


@cache
def offered() -> dict[str, EntryPoint]:
    """Return the entry points of the estimators of other installed packages, by name.

    An entry point is a line in the metadata of a package that names one of its functions. If an
    estimator has the same name as an estimator of this package (`BUILT_IN`), it is left out.
    """
    points = entry_points(group=GROUP)
    return {point.name: point for point in points if point.name not in BUILT_IN}


class Methods(Mapping[str, Factory]):
    """Mapping from the name of an estimator to its factory: the function that constructs it.

    The mapping also contains the estimators of other installed packages. Such a package is imported
    when one of its factories is requested for the first time.
    """

    def __getitem__(self, name: str) -> Factory:
        """Return the function that constructs the estimator with this name.

        Raises
        ------
        KeyError
            There is no estimator with this name.
        ValueError
            The package of the estimator cannot be imported, or does not contain the function.
        """
        if name in BUILT_IN:
            return BUILT_IN[name]
        point = offered()[name]
        try:
            factory: Factory = point.load()
        except (ImportError, AttributeError) as error:
            raise ValueError(
                f"estimator {name!r}: its entry point {point.value} cannot be loaded: {error}"
            ) from error
        return factory

    def __iter__(self) -> Iterator[str]:
        return iter((*BUILT_IN, *offered()))

    def __len__(self) -> int:
        return len(BUILT_IN) + len(offered())

    def __contains__(self, name: object) -> bool:
        return name in BUILT_IN or name in offered()


METHODS = Methods()
"""All estimators by name. `METHODS[name](preset)` constructs an estimator from settings."""


def named_estimators(names: str | Sequence[str]) -> tuple[str, ...]:
    """Check a selection of estimators, and return their names as a tuple.

    Parameters
    ----------
    names
        Names of estimators in `METHODS`, as a sequence or as one text with commas between the
        names. The single name `all` selects all estimators.

    Raises
    ------
    ValueError
        A name is unknown or repeated, or there is no name.
    """
    if isinstance(names, str):
        names = [name.strip() for name in names.split(",") if name.strip()]
    if list(names) == ["all"]:
        return tuple(METHODS)
    for name in names:
        if name not in METHODS:
            raise ValueError(f"estimator {name!r}: expected all, or some of {', '.join(METHODS)}")
        if list(names).count(name) > 1:
            raise ValueError(f"estimator {name!r} is given twice")
    if not names:
        raise ValueError(f"no estimator is given: expected all, or some of {', '.join(METHODS)}")
    return tuple(names)
