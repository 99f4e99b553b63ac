"""Models of the environment that are linear in their parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

SIZES: dict[str, Callable[[float, float, float], float]] = {
    "f0": lambda x, v, f: 1.0,
    "m": lambda x, v, f: v * v / x,
    "k3": lambda x, v, f: x**3,
    "tau": lambda x, v, f: f * v / x,
}
"""Functions that return a typical size of a regressor from typical x [m], v [m/s] and f [N].

The keys are the names of the parameters besides b and k. The arguments are in the order x, v, f.
"""
UNITS = {
    "b": "N s/m",
    "k": "N/m",
    "f0": "N",
    "m": "kg",
    "k3": "N/m^3",
    "tau": "s",
    "p": "N",
    "K": "N/m^n",
    "B": "N s/m^(n+1)",
    "n": "-",
}
"""Units of all quantities that an estimator may estimate, by name."""
POWERS_OF_X = ("k3", "n")
"""Parameters that only models nonlinear in x have. These models need x = 0 at the contact point."""
REGRESSOR_UNITS = {"f0": "-", "m": "m/s^2", "k3": "m^3", "tau": "N/s"}
"""Units of the regressors besides v and x, by the name of their parameter."""


@dataclass(frozen=True)
class Model:
    """A model f = phi' theta, with phi = [v, x, ...] and theta = [b, k, ...].

    Regressors besides v and x, such as x^3, are called further regressors. They must be computed
    from the measured signals and then filtered, because H[x^3] is not (H x)^3 for a filter H.
    `MatchedFilter` does this.

    Parameters
    ----------
    name
        Name of the model on the command line.
    further
        Names of the parameters besides b and k. Each is one of

        - `f0` [N], the force at x = 0; its regressor is 1;
        - `m` [kg], the mass that moves with the surface; its regressor is the acceleration;
        - `k3` [N/m^3], stiffening; its regressor is x^3;
        - `tau` [s], relaxation time; its regressor is minus the time derivative of f.

    Raises
    ------
    ValueError
        A parameter is unknown.
    """

    name: str
    further: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for parameter in self.further:
            if parameter not in SIZES:
                raise ValueError(f"parameter {parameter!r}: expected one of {', '.join(SIZES)}")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, b and k first."""
        return ("b", "k", *self.further)

    @property
    def regressors(self) -> int:
        """Number of regressors."""
        return 2 + len(self.further)

    @property
    def further_regressors(self) -> tuple[tuple[str, str], ...]:
        """Name of the parameter, and unit, of each regressor besides v and x."""
        return tuple((parameter, REGRESSOR_UNITS[parameter]) for parameter in self.further)

    def sizes(self, x: float, v: float, f: float) -> tuple[float, ...]:
        """Return a typical size of each regressor, from typical x [m], v [m/s] and f [N]."""
        return (v, x, *(SIZES[parameter](x, v, f) for parameter in self.further))


KELVIN_VOIGT = Model("kelvin-voigt")
"""f = b v + k x, equation (1) of the paper."""
WITH_DATUM = Model("datum", ("f0",))
"""f = b v + k x + f0, for an x that is not measured from the contact point."""
WITH_INERTIA = Model("inertia", ("m",))
"""f = b v + k x + m a, with the acceleration a."""
STIFFENING = Model("stiffening", ("k3",))
"""f = b v + k x + k3 x^3, where k is the stiffness at zero displacement."""
STANDARD_LINEAR_SOLID = Model("sls", ("tau",))
"""f + tau f' = b v + k x, with b = k tau + b1.

The body is a spring k in parallel with a second branch. The second branch is a spring k1 in series
with a damper b1 = k1 tau. The damping is b1 = b - k tau in slow motion, and the stiffness is
k + k1 = k + b1 / tau in fast motion.
"""

MODELS = {
    model.name: model
    for model in (KELVIN_VOIGT, WITH_DATUM, WITH_INERTIA, STIFFENING, STANDARD_LINEAR_SOLID)
}
"""The models by name."""


def model_named(name: str) -> Model:
    """Return the model of this name.

    Raises
    ------
    ValueError
        `MODELS` does not contain the name.
    """
    if name not in MODELS:
        raise ValueError(f"model {name!r}: expected one of {', '.join(MODELS)}")
    return MODELS[name]
