"""Define constants and checks for estimators of the Hunt-Crossley model f = K x^n + B x^n v."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

NAMES = ("b", "k", "K", "B", "n")
"""Names of the estimated quantities: the damping b and the stiffness k at the present displacement,
and the parameters K, B and n of the model."""
STIFFNESS, DAMPING, EXPONENT = 2, 3, 4
"""Indices of K, B and n in `theta`."""
HERTZ = 1.5
"""Initial guess of the exponent n. A sphere in contact with a plane has n = 1.5 (Hertz)."""
STEEPEST = 5.0
"""Upper limit of the exponent n. The lower limit is 0."""
PRIOR = 1e-8
"""Weight of the initial guess n = 1.5 and B = 0, relative to the weight of the samples."""
TOUCH = 1e-6
"""Smallest displacement that is treated as contact, relative to the typical displacement."""
LARGEST_LOG = 230.0
"""Largest magnitude of the logarithm of a force or of a stiffness."""
CONTACT_FORCE = 0.003
"""`hc_double` and `hc_log` ignore samples with a force below this limit.

The limit is relative to the typical force. For a typical force of 10 N it is 0.03 N, or 1.5
standard deviations of the noise in `benchmarks/bank_case.py`. Without contact, the force of 7 % of
the samples exceeds this limit. The logarithm of a force below the limit is mostly noise. In
contact, 0.1 and 10 times this value give the same result.
"""


def clamp(value: float, low: float, high: float) -> float:
    """Return `value`, limited to the range from `low` to `high`."""
    if value < low:
        return low
    return high if value > high else value


@dataclass(frozen=True, slots=True)
class HuntCrossleyParameters:
    """Constant settings of an estimator of the Hunt-Crossley model, which its `step` reads."""

    rate: float
    """1 / memory [1/s]."""
    x0: float
    """Typical displacement [m]."""
    v0: float
    """Typical velocity [m/s]."""
    threshold: float
    """A sample with this force or less is treated as no contact [N]."""
    log_x0: float
    """ln x0."""


def contact_parameters(
    memory: float, displacement: float, velocity: float, threshold: float
) -> dict[str, float]:
    """Check these settings, and return the fields of `HuntCrossleyParameters`.

    The limits 1e-30 and 1e30 prevent an overflow in the estimator.
    """
    settings = {
        "memory": memory,
        "displacement": displacement,
        "velocity": velocity,
        "threshold": threshold,
    }
    for name, value in settings.items():
        if not 1e-30 <= value <= 1e30:
            raise ValueError(f"{name} must be positive, got {value}")
    return {
        "rate": 1.0 / memory,
        "x0": displacement,
        "v0": velocity,
        "threshold": threshold,
        "log_x0": log(displacement),
    }
