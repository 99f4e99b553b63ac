"""Measure how often `teleop compare --anova` finds an effect: `python benchmarks/mixed_model.py`.

Results of recordings are drawn without any effect of the tested factor, and with one. The rate of
p < 0.05 without an effect should be 5 %. It is compared with two analyses of statsmodels: the
ordinary one, in which each recording is independent and has the same weight, and weighted least
squares, in which the weights are those of the intervals alone. The intervals of the recordings
differ by factors up to about ten.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import statsmodels.api as sm
from numpy.typing import NDArray

from teleop.evaluation.across.mixed_model import fit_mixed_model

SEED = 20461601
ALPHA = 0.05


class Study(NamedTuple):
    """Results of recordings, and their design."""

    y: NDArray[np.float64]
    std: NDArray[np.float64]
    """Standard deviations that the intervals state."""
    level: NDArray[np.int_]
    """Level of the tested factor."""
    group: NDArray[np.int_] | None
    """Level of the random factor, for example the specimen."""


def study(
    rng: np.random.Generator,
    groups: int,
    levels: int,
    repeats: int,
    between: float,
    interaction: float,
    spread: float,
    is_nested: bool = False,
) -> Study:
    """Draw the results of a study.

    `between`, `interaction` and `spread` are the standard deviations between the levels of the
    random factor, of its interaction with the tested factor, and between repeated recordings. If
    the design is nested, each level of the random factor has one level of the tested factor.
    """
    group, level, _ = (each.ravel() for each in np.mgrid[0:groups, 0:levels, 0:repeats])
    if is_nested:
        level = group % 2
    std = 0.7 * np.exp(rng.normal(0.0, 0.7, group.size))
    y = rng.normal(0.0, between, groups)[group]
    y += rng.normal(0.0, interaction, (groups, levels + 1))[group, level]
    y += rng.normal(0.0, spread, y.size) + std * rng.normal(0.0, 1.0, y.size)
    return Study(y, std, level, group if between or interaction else None)


def ours(one: Study) -> float:
    """Return p of the mixed model."""
    random = "specimen" if one.group is not None else None
    names = one.group.astype(str) if one.group is not None else ()
    found = fit_mixed_model(one.y, one.std, ["factor"], [one.level.astype(str)], random, names)
    return found.effects[0].p


def weighted(one: Study, weights: NDArray[np.float64]) -> float:
    """Return p of weighted least squares, in which each recording is independent."""
    design = sm.add_constant(
        (one.level[:, None] == np.arange(1, one.level.max() + 1)).astype(float)
    )
    return float(sm.WLS(one.y, design, weights).fit().f_pvalue)


METHODS: dict[str, Callable[[Study], float]] = {
    "--anova": ours,
    "ordinary": lambda one: weighted(one, np.ones(one.y.size)),
    "intervals only": lambda one: weighted(one, one.std**-2.0),
}
STUDIES: dict[str, dict[str, float]] = {
    "3 bodies, 5 recordings": {"groups": 5, "levels": 3, "repeats": 1, "spread": 0.8},
    "  spread much larger": {"groups": 5, "levels": 3, "repeats": 1, "spread": 5.0},
    "  no spread": {"groups": 5, "levels": 3, "repeats": 1, "spread": 0.0},
    "5 subjects, 4 bodies, 3 times": {
        **{"groups": 5, "levels": 4, "repeats": 3, "spread": 0.8},
        **{"between": 3.0, "interaction": 1.5},
    },
    "8 specimens, 2 treatments, 5 times": {
        **{"groups": 8, "levels": 1, "repeats": 5, "spread": 0.8, "between": 2.0},
        "is_nested": True,
    },
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--studies", type=int, default=1000)
    count = parser.parse_args().studies
    rng = np.random.default_rng(SEED)
    print(f"{count} studies of each kind, share with p < {ALPHA:g} [%]")
    print(f"{'without an effect':36}" + "".join(f"{name:>16}" for name in METHODS))
    for name, settings in STUDIES.items():
        hits = dict.fromkeys(METHODS, 0)
        for _ in range(count):
            one = study(rng, **{"between": 0.0, "interaction": 0.0} | settings)  # type: ignore[arg-type]
            for method, p_of in METHODS.items():
                hits[method] += p_of(one) < ALPHA
        print(f"{name:36}" + "".join(f"{100.0 * hit / count:16.1f}" for hit in hits.values()))
    print("with an effect of 1.5 standard deviations of the spread")
    name, settings = next(iter(STUDIES.items()))
    hits = dict.fromkeys(METHODS, 0)
    for _ in range(count):
        one = study(rng, **{"between": 0.0, "interaction": 0.0} | settings)  # type: ignore[arg-type]
        one = one._replace(y=one.y + 1.5 * 0.8 * one.level)
        for method, p_of in METHODS.items():
            hits[method] += p_of(one) < ALPHA
    print(f"{name:36}" + "".join(f"{100.0 * hit / count:16.1f}" for hit in hits.values()))


if __name__ == "__main__":
    main()
