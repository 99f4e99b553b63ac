"""Define constants and checks for estimators of the Hunt-Crossley model f = K x^n + B x^n v."""

from __future__ import annotations

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


def check_contact(memory: float, displacement: float, velocity: float, threshold: float) -> None:
    """Check the settings of an estimator of the Hunt-Crossley model f = K x^n + B x^n v.

    The limits 1e-30 and 1e30 prevent an overflow in the estimator.
    """
    for name, value in (
        ("memory", memory),
        ("displacement", displacement),
        ("velocity", velocity),
        ("threshold", threshold),
    ):
        if not 1e-30 <= value <= 1e30:
            raise ValueError(f"{name} must be positive, got {value}")
