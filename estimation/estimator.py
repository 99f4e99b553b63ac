"""What every estimator is: a step on scalars, run for one sample or over arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.checks import check_sample, checked_samples
from estimation.compiled import Floats, Law, Samples, interpreted, sweep
from estimation.model import KELVIN_VOIGT, POWERS_OF_X, UNITS, Model
from estimation.own_copies import own_copy
from estimation.step import B, K, Regressors, State, Step

UNKNOWN = 1e12
"""A standard deviation from here on says that nothing has been learned."""
LEVEL_95 = 1.959963984540054
"""Standard deviations to either side that hold 95 % of a normal distribution."""


class Estimate(NamedTuple):
    """What an estimator says after one sample."""

    b: float
    """Damping [N s/m]."""
    k: float
    """Stiffness [N/m]."""
    b_std: float
    """Standard deviation of the damping [N s/m]; NaN for a method that gives none."""
    k_std: float
    """Standard deviation of the stiffness [N/m]; NaN for a method that gives none."""
    held: bool
    """Whether the estimate was held, since the sample had nothing to say."""
    further: tuple[float, ...] = ()
    """Further parameters, and then their standard deviations."""


def estimate_of(state: State) -> Estimate:
    """The estimate of a state."""
    theta, std = state.theta, state.std
    further = (*theta[2:], *std[2:]) if len(theta) > 2 else ()
    values = (theta[B], theta[K], std[B], std[K], state.held, further)
    return tuple.__new__(Estimate, values)  # half the time of Estimate(...)


class Series(NamedTuple):
    """A parameter after each sample, arrays of shape (n,)."""

    value: Floats
    std: Floats
    """Its standard deviation; NaN for a method that gives none."""


class Estimates(NamedTuple):
    """What an estimator says after each sample, arrays of shape (n,)."""

    b: Floats
    """Damping [N s/m]."""
    k: Floats
    """Stiffness [N/m]."""
    b_std: Floats
    """Standard deviation of the damping [N s/m]; NaN for a method that gives none."""
    k_std: Floats
    """Standard deviation of the stiffness [N/m]; NaN for a method that gives none."""
    held: NDArray[np.bool_]
    """Whether the estimate was held."""
    further: Mapping[str, Series] = MappingProxyType({})
    """Further parameters by name."""

    def part(self, samples: slice) -> Estimates:
        """Those of some of the samples."""
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
    """Online estimator of an environment f = phi' theta, such as Kelvin-Voigt f = b v + k x, (1).

    A subclass gives `step`, the function that takes in one sample (`estimation/step.py`), its
    parameters and its first state. `update` and `run` both apply this one step, so they give the
    same numbers to the bit.

    Parameters
    ----------
    parameters
        The parameters of `step`, a frozen dataclass.
    initial_state
        The state before the first sample.
    model
        The regressors.
    names
        What is estimated, b and k first; by default the model's parameters.
    """

    gated: ClassVar[bool] = True
    """Whether a bank's gate holds the estimate while there is no contact or no motion."""
    constant: ClassVar[bool] = False
    """Whether its step takes the regressor 1 after those of the model."""

    @staticmethod
    @abstractmethod
    def step(parameters: Any, state: Any, phi: Regressors, f: float, dt: float) -> None:
        """Take in one sample: update the state in place."""

    _step: ClassVar[Step]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "step" in vars(cls):
            cls._step = staticmethod(interpreted(cls.step))
        for name in ("advance", "hold"):  # in a bank, they meet many classes of states
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
        """Whether x must be measured from the contact: the model is not linear in x."""
        return not set(POWERS_OF_X).isdisjoint(self.names)

    def reset(self) -> None:
        """Forget every sample."""
        self.state = deepcopy(self._initial_state)

    @property
    def estimate(self) -> Estimate:
        """The present estimate."""
        return estimate_of(self.state)

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of everything that is estimated, by name."""
        pairs = zip(self.state.theta, self.state.std, strict=True)
        return dict(zip(self.names, pairs, strict=True))

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each of `names`."""
        return tuple(UNITS[name] for name in self.names)

    def note(self, estimates: Estimates) -> str | None:
        """What a reader of these estimates of its own must know of them, in one line."""
        return None

    def update(
        self, x: float, v: float, f: float, dt: float, further: Sequence[float] = ()
    ) -> Estimate:
        """Take in one sample.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N].
        dt
            Time since the sample before [s].
        further
            The model's regressors besides v and x.

        Raises
        ------
        ValueError
            A value is not finite or absurdly large, `dt` is not positive, or there are not as many
            regressors as the model has. The estimator stays as it was.
        """
        x, v, f, dt = float(x), float(v), float(f), float(dt)
        further = [float(value) for value in further]
        check_sample(dt, further, x=x, v=v, f=f)
        self.check_further(len(further))
        return self.advance([v, x, *further], f, dt)

    def advance(self, phi: list[float], f: float, dt: float) -> Estimate:
        """Take in one sample of floats that `check_sample` has passed, phi = [v, x, ...]."""
        if self.constant:
            phi = [*phi, 1.0]
        state = self.state
        state.held = False
        type(self)._step(self.parameters, state, phi, f, dt)
        return estimate_of(state)

    def hold(self) -> Estimate:
        """Leave the estimate as it is, and mark it as held."""
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
        """Take in n samples as `update` would, one by one.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N], each of shape (n,).
        dt
            Time since the sample before [s], of shape (n,), or one number for all.
        further
            The model's regressors besides v and x, shape (n, regressors - 2).

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite, a `dt` is not positive, or there are not
            as many regressors as the model has. The estimator stays as it was.
        """
        samples = checked_samples(x, v, f, dt, further)
        self.check_further(samples.phi.shape[1] - 2)
        return self.advance_all(samples)

    def advance_all(self, samples: Samples) -> Estimates:
        """Take in samples that `checked_samples` has passed."""
        answers = sweep(self.law, self.state, self.as_taken(samples))
        size = len(self.names)
        columns = answers.T.copy()
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

    def as_taken(self, samples: Samples) -> Samples:
        """The samples as its step takes them."""
        if not self.constant:
            return samples
        return samples._replace(phi=np.column_stack((samples.phi, np.ones(len(samples.f)))))

    @property
    def law(self) -> Law:
        """The step with its parameters."""
        return Law(type(self).step, self.parameters)

    def check_further(self, count: int) -> None:
        """Raise ValueError unless the model has so many regressors besides v and x."""
        expected = self.model.regressors - 2
        if count != expected:
            raise ValueError(
                f"{count} regressors besides v and x were given, but the model "
                f"{self.model.name} has {expected}"
            )
