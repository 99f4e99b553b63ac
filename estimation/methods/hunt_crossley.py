"""What the estimators of the Hunt-Crossley model f = K x^n + B x^n v share."""

from __future__ import annotations

NAMES = ("b", "k", "K", "B", "n")
"""Damping and stiffness at the present displacement, and K, B and n of the model."""
STIFFNESS, DAMPING, EXPONENT = 2, 3, 4
"""Where K, B and n are in `theta`."""
HERTZ = 1.5
"""Exponent of a sphere on a plane: the first guess of n."""
STEEPEST = 5.0
"""Largest exponent; the least is 0."""
PRIOR = 1e-8
"""Weight of the first guess n = 1.5 and B = 0, as a share of the samples' weight."""
TOUCH = 1e-6
"""Least displacement in contact, as a share of the typical one."""
LARGEST_LOG = 230.0
"""Largest logarithm of a force or stiffness that is reported."""


def clamp(value: float, low: float, high: float) -> float:
    """The value, or the bound that it is beyond."""
    if value < low:
        return low
    return high if value > high else value


def check_contact(memory: float, displacement: float, velocity: float, threshold: float) -> None:
    """Raise ValueError unless all are positive and of a size that can be squared."""
    for name, value in (
        ("memory", memory),
        ("displacement", displacement),
        ("velocity", velocity),
        ("threshold", threshold),
    ):
        if not 1e-30 <= value <= 1e30:
            raise ValueError(f"{name} must be positive, got {value}")
