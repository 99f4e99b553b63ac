"""Read the plan of a sweep: the settings that vary, their values, and the task at each point.

The task is to run a trial, or to compute estimates from a recording.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    StringConstraints,
    ValidationError,
    model_validator,
)

from teleop.errors import InputError, invalid_parts
from teleop.settings.toml_files import read_toml

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,40}$")]
"""Name of a sweep, which is part of the name of the folder."""
Key = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)*$")]
"""Name of a setting. A dot separates the names of nested settings, as in `admittance.mass`."""
DesignName = Literal["grid", "list", "random", "latin-hypercube"]
MOST_POINTS = 10_000_000
"""Largest number of points of a sweep."""


class Range(BaseModel):
    """Range of the values that a setting has in a sweep."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    low: float
    """Lowest value."""
    high: float
    """Highest value."""
    steps: Annotated[int, Field(ge=2, le=MOST_POINTS)] | None = None
    """Number of values in the designs `grid` and `list`. Not used in the designs `random` and
    `latin-hypercube`."""
    scale: Literal["linear", "log"] = "linear"
    """`linear` if the values are evenly distributed; `log` if their logarithms are evenly
    distributed."""

    @model_validator(mode="after")
    def _ordered(self) -> Range:
        if not self.low < self.high:
            raise ValueError(f"expected low < high, got {self.low:g} and {self.high:g}")
        if self.scale == "log" and self.low <= 0.0:
            raise ValueError(f"expected low > 0 for a log scale, got {self.low:g}")
        return self


class Evaluated(BaseModel):
    """Recording from which a sweep computes estimates with different settings.

    Such a sweep runs no trials.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    recording: Annotated[str, Field(min_length=1)]
    """Path of the recording (.mcap), relative to the folder of the plan."""


class SweepPlan(BaseModel):
    """Plan of a sweep, which runs trials or computes estimates with different settings.

    A point of the sweep is one combination of values of the settings that vary.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name
    """Name of the sweep."""
    description: str = ""
    factors: dict[Key, Annotated[list[Any], Field(min_length=1)] | Range] = Field(min_length=1)
    """Values of each setting that varies: a list, or a range."""
    design: DesignName = "grid"
    """`grid`: all combinations of the values. `list`: the first point has the first value of each
    setting, the second point the second values, and so on. `random` and `latin-hypercube`: random
    values."""
    points: Annotated[int, Field(ge=1, le=MOST_POINTS)] | None = None
    """Number of combinations of values in the designs `random` and `latin-hypercube`."""
    seed: NonNegativeInt = 0
    """Seed of the random values in the designs `random` and `latin-hypercube`."""
    seeds: Annotated[int, Field(ge=1, le=MOST_POINTS)] = 1
    """Number of repetitions of each combination of values. The first repetition has the seed in the
    settings. Each further repetition has the next larger seed."""
    settings: dict[str, Any] = {}
    """Settings of all trials, as in a configuration file."""
    estimate: Evaluated | None = None
    """Recording from which estimates are computed at each point. By default, a trial is run on the
    simulated rig at each point instead."""

    @property
    def is_random(self) -> bool:
        """Whether the values of the settings are random: `random` or `latin-hypercube` design."""
        return self.design in ("random", "latin-hypercube")

    @property
    def size(self) -> int:
        """Number of points: combinations of values times repetitions with different seeds."""
        sizes = [
            (values.steps or 0) if isinstance(values, Range) else len(values)
            for values in self.factors.values()
        ]
        if self.is_random:
            return (self.points or 0) * self.seeds
        if self.design == "list":
            return sizes[0] * self.seeds
        count = self.seeds
        for size in sizes:
            count *= size
        return count


def read_plan(path: Path, seeds: int | None = None) -> SweepPlan:
    """Read the plan of a sweep from a file, and check it."""
    packaged = files(__package__).joinpath("plans", f"{path}.toml")
    if not path.suffix and packaged.is_file():
        with as_file(packaged) as source:
            document = read_toml(source)
    else:
        document = read_toml(path)
    if seeds is not None:
        document["seeds"] = seeds
    try:
        plan = SweepPlan.model_validate(document)
    except ValidationError as error:
        raise InputError(f"{path}: {invalid_parts(error)}") from error
    found = [*problems(plan)]
    if found:
        raise InputError("\n".join(f"{path}: {problem}" for problem in found))
    return plan


def problems(plan: SweepPlan) -> Iterator[str]:
    """Yield a message for each reason why the entries of a plan do not agree with each other."""
    for key, values in plan.factors.items():
        if isinstance(values, Range) and not values.steps and not plan.is_random:
            yield f"factors.{key}: expected steps, the number of values"
        if any(other.startswith(f"{key}.") for other in plan.factors):
            yield f"factors.{key}: is varied as a whole and in parts"
    if plan.is_random and plan.points is None:
        yield f"points: expected the number of points of a {plan.design} design"
    if not plan.is_random and plan.points is not None:
        yield f"points: expected none: the values determine the points of a {plan.design}"
    sizes = {
        values.steps if isinstance(values, Range) else len(values)
        for values in plan.factors.values()
    }
    if plan.design == "list" and len(sizes) > 1:
        yield "factors: expected the same number of values for each factor of a list"
    if plan.estimate and plan.seeds > 1:
        yield "seeds: expected none: the evaluation of a recording is not random"
    if plan.estimate and plan.settings:
        yield "settings: expected none: the settings of the recording are used"
    if "seed" in plan.factors and plan.seeds > 1:
        yield "seeds: expected none, because the factor seed sets the seed"
    if plan.size > MOST_POINTS:
        yield f"{plan.size} points: expected at most {MOST_POINTS}"
