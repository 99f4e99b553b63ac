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
"""Functions that return a typical magnitude of a regressor, for each regressor besides v and x.

The arguments are a typical displacement x [m], velocity v [m/s] and force f [N], in this order. The
key is the name of the parameter that is multiplied by the regressor.
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
"""Unit of each quantity that an estimator may estimate, by the name of the quantity."""
POWERS_OF_X = ("k3", "n")
"""Parameters of models that are nonlinear in x. Such a model needs x = 0 at the contact point."""
REGRESSOR_UNITS = {"f0": "-", "m": "m/s^2", "k3": "m^3", "tau": "N/s"}
"""Unit of each regressor besides v and x, by the name of the parameter that is multiplied by it."""


@dataclass(frozen=True)
class Model:
    """A model f = phi' theta, with the regressors phi = [v, x, ...] and theta = [b, k, ...].

    The regressors besides v and x, such as x^3, are called further regressors. The force and all
    regressors must pass through the same low-pass filter, as in `MatchedFilter`. For example, x^3
    is computed from the measured x and is then filtered. The third power of the filtered x would
    not be the same signal.

    Parameters
    ----------
    name
        Name of the model on the command line.
    further
        Names of the parameters besides b and k. Each name is one of

        - `f0` [N], the force at x = 0. The regressor is 1;
        - `m` [kg], the mass that moves with the surface. The regressor is the acceleration;
        - `k3` [N/m^3], the coefficient of the cubic term of the force. The regressor is x^3;
        - `tau` [s], the relaxation time. The regressor is minus the time derivative of f.

    Raises
    ------
    ValueError
        `further` contains an unknown name.
    """

    name: str
    further: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for parameter in self.further:
            if parameter not in SIZES:
                raise ValueError(f"parameter {parameter!r}: expected one of {', '.join(SIZES)}")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters of the model. The first two names are b and k."""
        return ("b", "k", *self.further)

    @property
    def regressors(self) -> int:
        """Number of regressors, including v and x."""
        return 2 + len(self.further)

    @property
    def further_regressors(self) -> tuple[tuple[str, str], ...]:
        """Name of the parameter and unit of the regressor, for each regressor besides v and x."""
        return tuple((parameter, REGRESSOR_UNITS[parameter]) for parameter in self.further)

    def sizes(self, x: float, v: float, f: float) -> tuple[float, ...]:
        """Return a typical magnitude of each regressor, in its SI unit.

        Parameters
        ----------
        x, v, f
            Typical magnitudes of displacement [m], velocity [m/s] and force [N].
        """
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
"""f + tau df/dt = b v + k x, with b = k tau + b1.

The body is a spring k in parallel with a second branch. The second branch is a spring k1 in series
with a damper b1 = k1 tau. In slow motion the body has the damping b1 = b - k tau. In fast motion it
has the stiffness k + k1 = k + b1 / tau.
"""

MODELS = {
    model.name: model
    for model in (KELVIN_VOIGT, WITH_DATUM, WITH_INERTIA, STIFFENING, STANDARD_LINEAR_SOLID)
}
"""All models, by name."""


def model_named(name: str) -> Model:
    """Return the model of the environment with this name."""
    if name not in MODELS:
        raise ValueError(f"model {name!r}: expected one of {', '.join(MODELS)}")
    return MODELS[name]
