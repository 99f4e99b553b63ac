"""What every estimator is: a step on scalars, run for one sample or over arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.checks import check_sample, checked_samples
from estimation.compiled import Floats, Law, Parameters, Regressors, Samples, State, Step, sweep
from estimation.model import KELVIN_VOIGT, POWERS_OF_X, UNITS, Model
from estimation.unrolled import Helpers, unrolled

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

    A subclass gives `step`, a function on scalars that moves the state on by one sample, the
    functions that it calls in `helpers`, and its `parameters`. Its state begins with the value
    of each of `names`, their standard deviations, and whether the estimate is held. `update`
    and `run` both apply this one step, so they give the same numbers to the bit.

    Parameters
    ----------
    parameters
        What `step` is given.
    initial_state
        The state before the first sample.
    model
        The regressors.
    names
        What is estimated, b and k first; by default the model's parameters.
    """

    helpers: ClassVar[Helpers] = ()
    gated: ClassVar[bool] = True
    """Whether a bank's gate holds the estimate where samples have nothing to say."""
    constant: ClassVar[bool] = False
    """Whether its step takes the regressor 1 after those of the model."""

    @staticmethod
    @abstractmethod
    def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
        """Move the state on by one sample, in place."""

    def __init__(
        self,
        parameters: Parameters,
        initial_state: Sequence[float],
        model: Model = KELVIN_VOIGT,
        names: tuple[str, ...] | None = None,
    ) -> None:
        self.model = model
        self.names = names or model.parameters
        self.parameters = [float(value) for value in parameters]
        self._initial_state = tuple(float(value) for value in initial_state)
        self.state = list(self._initial_state)
        self._step: Step | None = None

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled: all but the unrolled step, which is made anew."""
        return {**vars(self), "_step": None}

    @property
    def from_contact(self) -> bool:
        """Whether x must be measured from the contact: the model is not linear in x."""
        return not set(POWERS_OF_X).isdisjoint(self.names)

    def reset(self) -> None:
        """Forget every sample."""
        self.state = list(self._initial_state)

    @property
    def estimate(self) -> Estimate:
        """The present estimate."""
        state, size = self.state, len(self.names)
        if size == 2:
            return Estimate(state[0], state[1], state[2], state[3], state[4] != 0.0)
        further = (*state[2:size], *state[size + 2 : 2 * size])
        held = state[2 * size] != 0.0
        return Estimate(state[0], state[1], state[size], state[size + 1], held, further)

    @property
    def values(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of everything that is estimated, by name."""
        size = len(self.names)
        return {name: (self.state[i], self.state[size + i]) for i, name in enumerate(self.names)}

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
        if self._step is None:
            self._step, _ = unrolled(type(self).step, self.helpers, len(phi))
        self.state[2 * len(self.names)] = 0.0
        self._step(self.parameters, self.state, phi, f, dt)
        return self.estimate

    def hold(self) -> Estimate:
        """Leave the estimate as it is, and say so."""
        self.state[2 * len(self.names)] = 1.0
        return self.estimate

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
        """The step with all that it needs."""
        return Law(type(self).step, self.helpers, self.parameters, 2 * len(self.names) + 1)

    def check_further(self, count: int) -> None:
        """Raise ValueError unless the model has so many regressors besides v and x."""
        expected = self.model.regressors - 2
        if count != expected:
            raise ValueError(
                f"{count} regressors besides v and x were given, but the model "
                f"{self.model.name} has {expected}"
            )
