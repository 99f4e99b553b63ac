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
"""Typical size of each further regressor, from typical x [m], v [m/s] and f [N]."""
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
"""Units of all quantities that estimators report."""
POWERS_OF_X = ("k3", "n")
"""Parameters of models that are nonlinear in x, for which x must be measured from the contact."""
REGRESSOR_UNITS = {"f0": "-", "m": "m/s^2", "k3": "m^3", "tau": "N/s"}
"""Units of the further regressors."""


@dataclass(frozen=True)
class Model:
    """A model f = phi' theta, with phi = [v, x, ...] and theta = [b, k, ...].

    The further regressors are formed from the measured signals before any filter, because
    H[x^3] is not (H x)^3. `MatchedFilter` does this.

    Parameters
    ----------
    name
        Name of the model on the command line.
    further
        Parameters besides b and k, some of

        - `f0` [N], the force at x = 0, with the regressor 1;
        - `m` [kg], the mass that moves with the surface, with the acceleration;
        - `k3` [N/m^3], stiffening, with x^3;
        - `tau` [s], relaxation, with minus the time derivative of f.

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
        """Return typical sizes of all regressors, from typical x [m], v [m/s] and f [N]."""
        return (v, x, *(SIZES[parameter](x, v, f) for parameter in self.further))


KELVIN_VOIGT = Model("kelvin-voigt")
"""f = b v + k x, the paper's (1)."""
WITH_DATUM = Model("datum", ("f0",))
"""f = b v + k x + f0: the contact datum is not known."""
WITH_INERTIA = Model("inertia", ("m",))
"""f = b v + k x + m a: second order."""
STIFFENING = Model("stiffening", ("k3",))
"""f = b v + k x + k3 x^3, where k is the stiffness at zero displacement."""
STANDARD_LINEAR_SOLID = Model("sls", ("tau",))
"""f + tau f' = b v + k x: a spring k parallel to a spring k1 in series with a damper b1 = k1 tau.

b is k tau + b1. So b - k tau is the damping of slow motion, and k + b1 / tau is the stiffness of
fast motion.
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
