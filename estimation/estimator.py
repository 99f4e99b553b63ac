"""Base class of all estimators. It applies a step to one sample or to arrays of samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.checks import checked_samples, is_valid, sample_error
from estimation.compiled import Floats, Law, Samples, interpreted, sweep
from estimation.model import KELVIN_VOIGT, POWERS_OF_X, UNITS, Model
from estimation.own_copies import own_copy
from estimation.step import B, K, Regressors, State, Step

UNKNOWN = 1e12
"""A standard deviation of this size or more means that the data do not determine the parameter."""
LEVEL_95 = 1.959963984540054
"""Half width of the 95 % confidence interval of a normal distribution, in standard deviations."""


class Estimate(NamedTuple):
    """Estimate after one sample."""

    b: float
    """Damping [N s/m]."""
    k: float
    """Stiffness [N/m]."""
    b_std: float
    """Standard deviation of the damping [N s/m]; NaN if the method does not compute it."""
    k_std: float
    """Standard deviation of the stiffness [N/m]; NaN if the method does not compute it."""
    held: bool
    """True if the sample did not change the estimate."""
    further: tuple[float, ...] = ()
    """Values of the parameters besides b and k, followed by their standard deviations."""


def estimate_of(state: State) -> Estimate:
    """Return the estimate that a state contains."""
    theta, std = state.theta, state.std
    further = (*theta[2:], *std[2:]) if len(theta) > 2 else ()
    values = (theta[B], theta[K], std[B], std[K], state.held, further)
    return tuple.__new__(Estimate, values)  # takes half the time of Estimate(...)


class Series(NamedTuple):
    """Estimates of one parameter after each of n samples, as arrays of shape (n,)."""

    value: Floats
    """Estimated value."""
    std: Floats
    """Standard deviation; NaN if the method does not compute it."""


class Estimates(NamedTuple):
    """Estimates after each of n samples, as arrays of shape (n,)."""

    b: Floats
    """Damping [N s/m]."""
    k: Floats
    """Stiffness [N/m]."""
    b_std: Floats
    """Standard deviation of the damping [N s/m]; NaN if the method does not compute it."""
    k_std: Floats
    """Standard deviation of the stiffness [N/m]; NaN if the method does not compute it."""
    held: NDArray[np.bool_]
    """True if the sample did not change the estimate."""
    further: Mapping[str, Series] = MappingProxyType({})
    """Estimates of the parameters besides b and k, by name."""

    def part(self, samples: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Estimates:
        """Return the estimates of some of the samples, given by a slice, indices or a mask."""
        further = {name: Series(*(s[samples] for s in series)) for name, series in self[5].items()}
        b, k, b_std, k_std, held = (
            self.b[samples],
            self.k[samples],
            self.b_std[samples],
            self.k_std[samples],
            self.held[samples],
        )
        return Estimates(b, k, b_std, k_std, held, further)


class Estimator(ABC):
    """Online estimator of the parameters theta of an environment f = phi' theta.

    An example is the Kelvin-Voigt model f = b v + k x, equation (1) of the paper. Its regressors
    are phi = [v, x], and its parameters are theta = [b, k]. A subclass defines the function `step`
    that processes one sample (`estimation/step.py`), the constant settings of this function, and
    the initial state. `update` and `run` both apply `step`, so their results are identical to the
    bit.

    Parameters
    ----------
    parameters
        Constant settings of `step`, a frozen dataclass.
    initial_state
        State before the first sample.
    model
        Model that defines the regressors.
    names
        Names of the estimated quantities, b and k first. Default: the model's parameters.
    """

    gated: ClassVar[bool] = True
    """Whether a contact gate applies. If so, theta changes only during contact and motion."""
    constant: ClassVar[bool] = False
    """Whether the step needs a constant regressor 1 after the regressors of the model."""

    @staticmethod
    @abstractmethod
    def step(parameters: Any, state: Any, phi: Regressors, f: float, dt: float) -> None:
        """Process one sample and update the state in place."""

    _step: ClassVar[Step]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "step" in vars(cls):
            cls._step = staticmethod(interpreted(cls.step))
        for name in ("advance", "hold"):  # separate copies for each class of state: faster
            setattr(cls, name, own_copy(getattr(cls, name)))

    def __init__(
        self,
        parameters: Any,
        initial_state: State,
        model: Model = KELVIN_VOIGT,
        names: tuple[str, ...] | None = None,
    ) -> None:
        self.model = model
        self.names = names or model.parameters
        self.parameters = parameters
        self._initial_state = initial_state
        self.state = deepcopy(initial_state)

    @property
    def from_contact(self) -> bool:
        """Whether x must be measured from the contact point.

        The property is True if the force of the model is a nonlinear function of x.
        """
        return not set(POWERS_OF_X).isdisjoint(self.names)

    def reset(self) -> None:
        """Discard all samples."""
        self.state = deepcopy(self._initial_state)

    @property
    def estimate(self) -> Estimate:
        """The present estimate."""
        return estimate_of(self.state)

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """Pairs (value, standard deviation) of the estimated quantities, by name."""
        pairs = zip(self.state.theta, self.state.std, strict=True)
        return dict(zip(self.names, pairs, strict=True))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the estimated quantities, in the order of `names`."""
        return tuple(UNITS[name] for name in self.names)

    def note(self, estimates: Estimates) -> str | None:
        """Return one line of text about the estimates, for example a warning; None for no text."""
        return None

    def update(
        self, x: float, v: float, f: float, dt: float, further: Sequence[float] = ()
    ) -> Estimate:
        """Process one sample.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N].
        dt
            Time since the previous sample [s].
        further
            The model's regressors besides v and x.

        Raises
        ------
        ValueError
            A value is not finite or too large, `dt` is not positive, or the number of regressors
            differs from that of the model. The state of the estimator does not change.
        """
        x, v, f, dt = float(x), float(v), float(f), float(dt)
        further = [float(value) for value in further]
        if not is_valid(dt, abs(x) + abs(v) + abs(f) + sum(map(abs, further))):
            raise sample_error(dt, further, x=x, v=v, f=f)
        self.check_further(len(further))
        return self.advance([v, x, *further], f, dt)

    def advance(self, phi: list[float], f: float, dt: float) -> Estimate:
        """Process one sample phi = [v, x, ...], f [N], dt [s] that has passed `is_valid`."""
        if self.constant:
            phi = [*phi, 1.0]
        state = self.state
        state.held = False
        type(self)._step(self.parameters, state, phi, f, dt)
        return estimate_of(state)

    def hold(self) -> Estimate:
        """Return the present estimate with `held` = True. The values do not change."""
        state = self.state
        state.held = True
        return estimate_of(state)

    def run(
        self,
        x: ArrayLike,
        v: ArrayLike,
        f: ArrayLike,
        dt: ArrayLike,
        further: ArrayLike | None = None,
    ) -> Estimates:
        """Process n samples, with the same results as n calls of `update`.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N], each of shape (n,).
        dt
            Time since the previous sample [s], of shape (n,), or one number for all.
        further
            The model's regressors besides v and x, shape (n, regressors - 2).

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite, a `dt` is not positive, or the number of
            regressors differs from that of the model. The state does not change.
        """
        samples = checked_samples(x, v, f, dt, further)
        self.check_further(samples.phi.shape[1] - 2)
        return self.advance_all(samples)

    def advance_all(self, samples: Samples) -> Estimates:
        """Process samples that `checked_samples` returned."""
        table = sweep(self.law, self.state, self.step_samples(samples))
        size = len(self.names)
        columns = table.T.copy()
        return Estimates(
            columns[0],
            columns[1],
            columns[size],
            columns[size + 1],
            columns[2 * size] != 0.0,
            {
                name: Series(columns[i], columns[size + i])
                for i, name in enumerate(self.names)
                if i > 1
            },
        )

    def step_samples(self, samples: Samples) -> Samples:
        """Return the samples with all regressors that `step` needs.

        If the class attribute `constant` is True, a regressor that is always 1 is added after the
        regressors of the model.
        """
        if not self.constant:
            return samples
        return samples._replace(phi=np.column_stack((samples.phi, np.ones(len(samples.f)))))

    @property
    def law(self) -> Law:
        """The function `step` of the class, and the values of its constant settings."""
        return Law(type(self).step, self.parameters)

    def check_further(self, count: int) -> None:
        """Raise ValueError unless the model has this number of regressors besides v and x."""
        expected = self.model.regressors - 2
        if count != expected:
            raise ValueError(
                f"{count} regressors besides v and x were given, but the model "
                f"{self.model.name} has {expected}"
            )
