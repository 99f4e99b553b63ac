"""Define the base class of all estimators. It processes one sample or arrays of samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.arrays import Floats
from estimation.checks import checked_samples, is_valid, sample_error
from estimation.compiled import Law, Samples, interpreted, own_copy, sweep
from estimation.model import KELVIN_VOIGT, POWERS_OF_X, UNITS, Model
from estimation.step import B, K, Regressors, State, Step

UNKNOWN = 1e12
"""A standard deviation of this value or more means that the data do not determine the parameter."""
LEVEL_95 = 1.959963984540054
"""Half width of the 95 % confidence interval of a normal distribution, in standard deviations."""


class Estimate(NamedTuple):
    """Estimated damping and stiffness after one sample."""

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
    """Return the estimate that the state of an estimator contains."""
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
    """Estimated damping and stiffness after each of n samples, as arrays of shape (n,)."""

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
        """Return the estimates after the selected samples, given by a slice, indices or a mask."""
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
    that processes one sample (`estimation.step`), the constant settings of this function, and the
    initial state. The method `update` processes one sample, and the method `run` processes arrays
    of samples. Both call `step`, so their results are identical to the bit.

    Parameters
    ----------
    parameters
        Constant settings of `step`, a frozen dataclass.
    initial_state
        State before the first sample. `step` updates a copy of this state.
    model
        Model that defines the regressors.
    names
        Names of the estimated quantities, b and k first. Default: names of the model's parameters.
    """

    gated: ClassVar[bool] = True
    """If True, the estimates do not change while a contact gate is closed (`estimation.gate`)."""
    used_settings: ClassVar[tuple[str, ...] | None] = None
    """Fields of `OwnSettings` that the estimator uses. Other settings are refused as own settings
    of this estimator. None: not declared, so none is refused."""
    constant: ClassVar[bool] = False
    """Whether the step needs a constant regressor 1 after the regressors of the model."""

    @staticmethod
    @abstractmethod
    def step(parameters: Any, state: Any, phi: Regressors, f: float, dt: float) -> None:
        """Process one sample: update `state` in place, including the estimate `state.theta`.

        `parameters` contains the constant settings, `phi` the regressors [v, x, ...], `f` the force
        [N], and `dt` the time since the previous sample [s].
        """

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
        """Set the state to the initial state, as before the first sample."""
        self.state = deepcopy(self._initial_state)

    @property
    def estimate(self) -> Estimate:
        """Estimate after the latest sample."""
        return estimate_of(self.state)

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """Present value and standard deviation of each estimated quantity, by its name."""
        pairs = zip(self.state.theta, self.state.std, strict=True)
        return dict(zip(self.names, pairs, strict=True))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the estimated quantities, in the order of `names`."""
        return tuple(UNITS[name] for name in self.names)

    def note(self, estimates: Estimates) -> str | None:
        """Return a remark about the estimates, for example a warning, or None if there is none."""
        return None

    def update(
        self, x: float, v: float, f: float, dt: float, further: Sequence[float] = ()
    ) -> Estimate:
        """Process one sample, and return the new estimate.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N].
        dt
            Time since the previous sample [s].
        further
            Values of the model's regressors besides v and x.

        Raises
        ------
        ValueError
            A value is not finite or too large, `dt` is not positive, or the model has a different
            number of regressors. The state of the estimator does not change.
        """
        x, v, f, dt = float(x), float(v), float(f), float(dt)
        further = [float(value) for value in further]
        if not is_valid(dt, abs(x) + abs(v) + abs(f) + sum(map(abs, further))):
            raise sample_error(dt, further, x=x, v=v, f=f)
        self.check_further(len(further))
        return self.advance([v, x, *further], f, dt)

    def advance(self, phi: list[float], f: float, dt: float) -> Estimate:
        """Process one sample without a check of its values; return the new estimate.

        `phi` contains the regressors [v, x, ...], `f` is the force [N], and `dt` is the time since
        the previous sample [s]. The caller must check them (`estimation.checks.is_valid`).
        """
        if self.constant:
            phi = [*phi, 1.0]
        state = self.state
        state.held = False
        type(self)._step(self.parameters, state, phi, f, dt)
        return estimate_of(state)

    def hold(self) -> Estimate:
        """Return the unchanged estimate for a sample that is not used. Its field `held` is True."""
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
        """Process n samples, and return the n estimates, which are those of n calls of `update`.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N], each of shape (n,).
        dt
            Time since the previous sample [s], of shape (n,), or one number for all samples.
        further
            Values of the model's regressors besides v and x, shape (n, regressors - 2).

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite or too large, a `dt` is not positive, or the
            model has a different number of regressors. The state does not change.
        """
        samples = checked_samples(x, v, f, dt, further)
        self.check_further(samples.phi.shape[1] - 2)
        return self.advance_all(samples)

    def advance_all(self, samples: Samples) -> Estimates:
        """Process n samples without a check of their values; return the n estimates.

        The caller must check the samples (`estimation.checks.checked_samples`). The samples for
        which `samples.open` is False do not change the estimates.
        """
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
        """Return the samples with all regressors that the function `step` needs.

        If the class attribute `constant` is True, `step` needs a regressor that is always 1. This
        regressor is added after the regressors of the model.
        """
        if not self.constant:
            return samples
        return samples._replace(phi=np.column_stack((samples.phi, np.ones(len(samples.f)))))

    @property
    def law(self) -> Law:
        """Pair of the function `step` of this class and the constant settings of this function."""
        return Law(type(self).step, self.parameters)

    def check_further(self, count: int) -> None:
        """Raise ValueError unless the model has `count` regressors besides v and x."""
        expected = self.model.regressors - 2
        if count != expected:
            raise ValueError(
                f"{count} regressors besides v and x were given, but the model "
                f"{self.model.name} has {expected}"
            )
