"""Find an estimator by its name.

The estimators are those of this package, and those that other installed packages register with
entry points (lines in the metadata of a package that name one of its functions).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, NamedTuple

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
from estimation.methods.kalman_filter import RandomWalkKalman
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


BUILT_IN: dict[str, Factory] = {
    "rls": RecursiveLeastSquares.from_settings,
    "ai": AdaptiveIdentification.from_settings,
    "me": MultiEstimator.from_settings,
    "rls_conditional": ConditionalUpdate.from_settings,
    "rls_directional": DirectionalForgetting.from_settings,
    "rls_sift": SubspaceForgetting.from_settings,
    "rls_trace": ConstantTrace.from_settings,
    "kalman": RandomWalkKalman.from_settings,
    "observer": ActiveObserver.from_settings,
    "passive": PassiveLeastSquares.from_settings,
    "window": BatchWindow.from_settings,
    "ai_normalised": NormalisedIdentification.from_settings,
    "indirect": IndirectAdaptive.from_settings,
    "reference": ReferenceModel.from_settings,
    "composite": CompositeAdaptive.from_settings,
    "spectral": SpectralRatio.from_settings,
    "hc_double": DoubleStage.from_settings,
    "hc_log": Logarithmic.from_settings,
    "me_switching": SwitchingMultiEstimator.from_settings,
    "me_moving": CoarseToFine.from_settings,
    "segments": PooledSegments.from_settings,
}
"""Functions that construct the estimators of this package, by the name of the estimator."""


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Pattern of the name of an estimator. It is part of the names of columns in recordings."""


class Offered(NamedTuple):
    """The estimators of other installed packages."""

    points: dict[str, EntryPoint]
    """Entry points (lines in the metadata of a package that name one of its functions), by name."""
    problems: dict[str, str]
    """Why an estimator cannot be used, by its name: the name is invalid or ambiguous."""


@cache
def offered() -> Offered:
    """Return the estimators of other installed packages."""
    points: dict[str, EntryPoint] = {}
    problems = {}
    for point in entry_points(group=GROUP):
        name, which = point.name, f"estimator {point.name!r} of the package {package(point)}"
        if not NAME.fullmatch(name):
            problems[name] = f"{which}: expected a name of letters, digits and _"
        elif name in BUILT_IN or name == "all":
            problems[name] = f"{which}: teleop uses this name itself: expected another name"
        elif name in points:
            other = package(points[name])
            problems[name] = f"{which}: the package {other} has an estimator of the same name"
        else:
            points[name] = point
    return Offered(points, problems)


def package(point: EntryPoint) -> str:
    """Return name and version of the installed package to which an entry point belongs."""
    return f"{point.dist.name} {point.dist.version}" if point.dist else "unknown"


def made_by(point: EntryPoint, step: str, call: Callable[[], Any], *passed: type[Exception]) -> Any:
    """Call a function of another package, and return its result.

    `passed` are exceptions that are raised unchanged. All others except KeyboardInterrupt become a
    ValueError, for example SystemExit, which would end the program without a message. `step` says
    for the message what failed, such as `loaded`.
    """
    try:
        return call()
    except BaseException as error:
        if isinstance(error, (KeyboardInterrupt, *passed)):
            raise
        raise ValueError(
            f"estimator {point.name!r} of the package {package(point)}: {point.value} cannot be "
            f"{step}: {type(error).__name__}: {' '.join(str(error).split())}"
        ) from error


class Methods(Mapping[str, Factory]):
    """Mapping from the name of an estimator to its factory: the function that constructs it.

    The mapping also contains the estimators of other installed packages. Such a package is imported
    when one of its factories is requested for the first time.
    """

    def __getitem__(self, name: str) -> Factory:
        """Return the function that constructs the estimator with this name."""
        if name in BUILT_IN:
            return BUILT_IN[name]
        point = offered().points[name]
        factory = made_by(point, "loaded", point.load)

        def make(settings: MethodSettings) -> Estimator:
            estimator = made_by(point, "called", lambda: factory(settings), ValueError)
            if not isinstance(estimator, Estimator):
                raise ValueError(
                    f"estimator {name!r} of the package {package(point)}: {point.value} returned "
                    f"{type(estimator).__name__}: expected an Estimator"
                )
            return estimator

        return make

    def __iter__(self) -> Iterator[str]:
        return iter((*BUILT_IN, *offered().points))

    def __len__(self) -> int:
        return len(BUILT_IN) + len(offered().points)

    def __contains__(self, name: object) -> bool:
        return name in BUILT_IN or name in offered().points


METHODS = Methods()
"""All estimators by name. `METHODS[name](preset)` constructs an estimator from settings."""


def named_estimators(names: str | Sequence[str]) -> tuple[str, ...]:
    """Check a selection of estimators, and return their names as a tuple.

    `names` is a sequence, or one text with commas. The single name `all` selects all estimators.
    ValueError if a name is unknown, repeated or missing, or if an estimator of another package has
    an invalid or ambiguous name. The name of an estimator of this package always means this
    estimator; only `all` is then refused.
    """
    if isinstance(names, str):
        names = [name.strip() for name in names.split(",") if name.strip()]
    problems = offered().problems
    if list(names) == ["all"]:
        if problems:
            raise ValueError("; ".join(problems.values()))
        return tuple(METHODS)
    for name in names:
        if name in problems and name not in BUILT_IN:
            raise ValueError(problems[name])
        if name not in METHODS:
            similar = get_close_matches(name, METHODS, 1)
            hint = f"did you mean {similar[0]}? " if similar else ""
            expected = f"{hint}expected all, or some of {', '.join(METHODS)}"
            raise ValueError(f"estimator {name!r}: {expected}")
        if list(names).count(name) > 1:
            raise ValueError(f"estimator {name!r} is given twice")
    if not names:
        raise ValueError(f"no estimator is given: expected all, or some of {', '.join(METHODS)}")
    return tuple(names)
