"""Several named estimators fed by the same samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from numpy.typing import ArrayLike

from estimation.estimator import Estimate, Estimates, Estimator, check_sample


class Bank(Mapping[str, Estimator]):
    """Named estimators that take in the same samples.

    Parameters
    ----------
    estimators
        The estimators by name, in the order in which they are reported.

    Raises
    ------
    ValueError
        There is none.

    Examples
    --------
    >>> from estimation import paper_preset
    >>> bank = paper_preset("soft").bank()
    >>> bank.update(x=2e-3, v=0.01, f=4.5, dt=1e-3)["me"]
    Estimate(b=25.0, k=2100.0)
    """

    def __init__(self, estimators: Mapping[str, Estimator]) -> None:
        if not estimators:
            raise ValueError("a bank needs at least one estimator")
        self._estimators = dict(estimators)

    def __getitem__(self, name: str) -> Estimator:
        return self._estimators[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._estimators)

    def __len__(self) -> int:
        return len(self._estimators)

    def reset(self) -> None:
        """Let every estimator forget every sample."""
        for estimator in self._estimators.values():
            estimator.reset()

    def update(self, x: float, v: float, f: float, dt: float) -> dict[str, Estimate]:
        """Take in one sample; arguments and errors as `Estimator.update`."""
        x, v, f, dt = float(x), float(v), float(f), float(dt)
        check_sample(dt, x=x, v=v, f=f)
        return {name: e.advance(x, v, f, dt) for name, e in self._estimators.items()}

    def run(self, x: ArrayLike, v: ArrayLike, f: ArrayLike, dt: ArrayLike) -> dict[str, Estimates]:
        """Take in n samples; arguments and errors as `Estimator.run`."""
        return {name: e.run(x, v, f, dt) for name, e in self._estimators.items()}
