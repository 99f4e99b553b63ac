"""Run several estimators on the same samples. `Bank` is a set of estimators with names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.checks import checked_samples, is_valid, sample_error
from estimation.compiled import Samples
from estimation.estimator import Estimate, Estimates, Estimator
from estimation.gate import Gate


class Bank(Mapping[str, Estimator]):
    """Estimators that process the same samples. Each estimator has a name.

    A sample may have regressors besides v and x. An estimator with the Kelvin-Voigt model uses v
    and x only. An estimator with another model uses all regressors of the sample.

    Parameters
    ----------
    estimators
        The estimators by name, in the order in which they are reported.
    gate
        Gate that is closed while there is no contact or no motion. The estimates do not change
        while the gate is closed. Estimators whose attribute `gated` is False ignore the gate, for
        example `RecursiveLeastSquares`. None: no gate.

    Raises
    ------
    ValueError
        There is no estimator; or the estimators have two or more different models besides the
        Kelvin-Voigt model.

    Examples
    --------
    Recursive least squares (`rls`) finds k = 2100 N/m after one second of a sine:

    >>> from math import cos, sin
    >>> from estimation import paper_preset
    >>> bank = paper_preset("soft").bank()
    >>> for i in range(1000):
    ...     x, v = 4e-3 - 3e-3 * cos(6e-3 * i), 18e-3 * sin(6e-3 * i)
    ...     estimates = bank.update(x, v, f=2100.0 * x + 15.0 * v, dt=1e-3)
    >>> round(estimates["rls"].k, 1)
    2100.0
    """

    def __init__(self, estimators: Mapping[str, Estimator], gate: Gate | None = None) -> None:
        if not estimators:
            raise ValueError("a bank needs at least one estimator")
        models = {e.model for e in estimators.values() if e.model.further}
        if len(models) > 1:
            raise ValueError(
                f"a bank has one model, got {', '.join(sorted(model.name for model in models))}"
            )
        self._estimators = dict(estimators)
        self._further = len(models.pop().further) if models else 0
        self._online = [
            (name, e.advance, e.hold, bool(e.model.further), e.gated)
            for name, e in self._estimators.items()
        ]
        self.gate = gate
        self.opened = np.zeros(0, dtype=np.bool_)
        """Whether the gate was open at each of the n samples of the last `run` or `each`, (n,)."""

    def __getitem__(self, name: str) -> Estimator:
        return self._estimators[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._estimators)

    def __len__(self) -> int:
        return len(self._estimators)

    def reset(self) -> None:
        """Reset every estimator to its state before the first sample.

        The contact gate of the bank is also reset, if there is one.
        """
        for estimator in self._estimators.values():
            estimator.reset()
        if self.gate:
            self.gate.reset()

    def update(
        self, x: float, v: float, f: float, dt: float, further: Sequence[float] = ()
    ) -> dict[str, Estimate]:
        """Process one sample with each estimator of the bank.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N].
        dt
            Time since the previous sample [s].
        further
            Regressors besides v and x; empty for the Kelvin-Voigt model.

        Returns
        -------
        Dictionary from the name of each estimator to its estimate.

        Raises
        ------
        ValueError
            A value is not finite or too large, `dt` is not positive, or the number of regressors
            is wrong. The states of the estimators do not change.
        """
        x, v, f, dt = float(x), float(v), float(f), float(dt)
        further = [float(value) for value in further]
        if not is_valid(dt, abs(x) + abs(v) + abs(f) + sum(map(abs, further))):
            raise sample_error(dt, further, x=x, v=v, f=f)
        self._check_further(len(further))
        plain, phi = [v, x], [v, x, *further]
        is_open = self.gate is None or self.gate.update(plain, f, dt)
        return {
            name: advance(phi if uses_all else plain, f, dt) if is_open or not gated else hold()
            for name, advance, hold, uses_all, gated in self._online
        }

    def run(
        self,
        x: ArrayLike,
        v: ArrayLike,
        f: ArrayLike,
        dt: ArrayLike,
        further: ArrayLike | None = None,
    ) -> dict[str, Estimates]:
        """Process n samples with each estimator of the bank.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N], each of shape (n,).
        dt
            Time since the previous sample [s], of shape (n,), or one number for all samples.
        further
            Regressors besides v and x, shape (n, regressors - 2); None if there are none.

        Returns
        -------
        Dictionary from the name of each estimator to its estimates after each of the n samples.

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite or too large, a `dt` is not positive, or the
            number of regressors is wrong. The states of the estimators do not change.
        """
        return dict(self.each(x, v, f, dt, further))

    def each(
        self,
        x: ArrayLike,
        v: ArrayLike,
        f: ArrayLike,
        dt: ArrayLike,
        further: ArrayLike | None = None,
    ) -> Iterator[tuple[str, Estimates]]:
        """Process n samples with one estimator after the other; yield pairs (name, estimates).

        The parameters are those of `Bank.run`. Each estimator processes the samples only when the
        caller asks for the next pair. The caller must therefore iterate to the end. Otherwise the
        remaining estimators do not process these samples.
        """
        samples = checked_samples(x, v, f, dt, further)
        self._check_further(samples.phi.shape[1] - 2)
        plain = samples._replace(phi=np.ascontiguousarray(samples.phi[:, :2]))
        self.opened = is_open = self._open_samples(plain)
        for name, e in self._estimators.items():
            yield name, e.advance_all(self._samples_of(e, samples, plain, is_open))

    def _open_samples(self, samples: Samples) -> NDArray[np.bool_]:
        return self.gate.run(samples) if self.gate else samples.open

    def _samples_of(
        self, e: Estimator, samples: Samples, plain: Samples, is_open: np.ndarray
    ) -> Samples:
        chosen = samples if e.model.further else plain
        return chosen._replace(open=is_open) if e.gated else chosen

    def _check_further(self, count: int) -> None:
        if count != self._further:
            raise ValueError(
                f"{count} regressors besides v and x were given, but the bank's model has "
                f"{self._further}"
            )
