"""The public names of the package, which `estimation` provides."""

from estimation.bank import Bank
from estimation.batch_fit import Fit, least_squares
from estimation.conditioning import (
    Conditioner,
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    Regression,
    StateVariableFilter,
)
from estimation.estimator import Estimate, Estimates, Estimator
from estimation.expected_intervals import ExpectedHalfWidths, ExpectedIntervals
from estimation.gate import Gate, GateSettings
from estimation.identification import Identification, identify
from estimation.methods.adaptive_identification import AdaptiveIdentification
from estimation.methods.batch_window import BatchWindow
from estimation.methods.grid import Axis, Grid
from estimation.methods.multi_estimator import MultiEstimator
from estimation.methods.pooled_segments import PooledSegments
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.metrics import coverage, estimated_force, force_error, predicted_force, rise_time
from estimation.misfit import Misfit
from estimation.model import MODELS, Model
from estimation.presets import Preset, paper_preset, scaled_preset
from estimation.registry import METHODS

__all__ = [
    "METHODS",
    "MODELS",
    "AdaptiveIdentification",
    "Axis",
    "Bank",
    "BatchWindow",
    "Conditioner",
    "Estimate",
    "Estimates",
    "Estimator",
    "ExpectedHalfWidths",
    "ExpectedIntervals",
    "FilteredDifference",
    "FirstOrderAdaptiveWindowing",
    "Fit",
    "Gate",
    "GateSettings",
    "Grid",
    "Identification",
    "MatchedFilter",
    "Misfit",
    "Model",
    "MultiEstimator",
    "PooledSegments",
    "Preset",
    "RecursiveLeastSquares",
    "Regression",
    "StateVariableFilter",
    "coverage",
    "estimated_force",
    "force_error",
    "identify",
    "least_squares",
    "paper_preset",
    "predicted_force",
    "rise_time",
    "scaled_preset",
]
