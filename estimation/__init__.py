"""Online estimation of a Kelvin-Voigt environment's damping and stiffness, f = b v + k x."""

from estimation.adaptive_identification import AdaptiveIdentification
from estimation.bank import Bank
from estimation.conditioning import (
    Conditioner,
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    StateVariableFilter,
)
from estimation.estimator import Estimate, Estimates, Estimator
from estimation.excitation import Excitation
from estimation.least_squares import Fit, least_squares
from estimation.metrics import estimated_force, force_error, predicted_force, rise_time
from estimation.multi_estimator import Axis, Grid, MultiEstimator
from estimation.presets import Preset, paper_preset, scaled_preset
from estimation.recursive_least_squares import RecursiveLeastSquares

__all__ = [
    "AdaptiveIdentification",
    "Axis",
    "Bank",
    "Conditioner",
    "Estimate",
    "Estimates",
    "Estimator",
    "Excitation",
    "FilteredDifference",
    "FirstOrderAdaptiveWindowing",
    "Fit",
    "Grid",
    "MatchedFilter",
    "MultiEstimator",
    "Preset",
    "RecursiveLeastSquares",
    "StateVariableFilter",
    "estimated_force",
    "force_error",
    "least_squares",
    "paper_preset",
    "predicted_force",
    "rise_time",
    "scaled_preset",
]
