"""What a step is: the function that a method is written as, and the state that it updates.

A method is one function

    step(parameters, state, phi, f, dt)

that takes in one sample: the regressors `phi` = (v, x, ...), the force `f` [N] and the time `dt`
since the sample before [s]. It reads `parameters` and updates `state` in place. Both are
dataclasses, whose fields have a name, a type and a description each:

    @dataclass(frozen=True, slots=True)
    class RlsParameters:
        beta: float             # forgetting factor

    @dataclass(slots=True)
    class RlsState(State):      # State has theta, std and held
        P: Matrix               # covariance, (m, m)
        noise: float            # variance of the noise [N^2]

    def step(parameters, state, phi, f, dt):
        P = state.P
        for i in below[len(phi)]:
            ... P[i][j] ...
        state.noise += ...

A field is a float, an int, a bool, a `Vector`, a `Matrix`, or another such dataclass. The size of a
vector or a matrix is that of its first value; it stays.

The same source runs in two ways, with the same numbers to the bit:

- interpreted, in the live loop: vectors are lists and matrices are lists of lists;
- compiled by numba over arrays of samples: the state is one record of numpy with the same names,
  vectors and matrices are views of it, and `phi` is a tuple (`estimation/compiled.py`).

So a step may do what Python and numba both can: arithmetic, comparisons, `math`, loops, and calls
of functions that are written in the same way; these are compiled with it. Three rules:

- vectors and matrices are changed element by element, `P[i][j] = ...`, never replaced;
- nothing is divided by zero, and no root or logarithm is taken where it is not defined, whatever
  the sample: Python raises an error there, and compiled code goes on with inf or nan;
- loops over regressors are written `for i in below[m]`, which is `for i in range(m)` in half the
  time. `range` is right as well.

Records of named fields were chosen by measurement, for recursive least squares with its interval:
30 ns a sample compiled, against 350 ns with a NamedTuple of separate arrays and 125 ns with a flat
list of numbers; interpreted 2.6 us against 2.8 us. A scalar that a step updates is a field like
any other, which a NamedTuple does not permit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

Vector = list[float]
"""Shape (m,)."""
Matrix = list[list[float]]
"""Shape (m, n), row by row."""
Regressors = Sequence[float]
"""phi = (v, x, ...) of one sample: v in m/s, x in m."""
Step = Callable[[Any, Any, Regressors, float, float], None]
"""(parameters, state, phi, f, dt): takes in one sample."""

B, K = 0, 1
"""Where damping and stiffness are in `theta`, `std` and the regressors."""


@dataclass(slots=True)
class State:
    """What every state has: the estimate."""

    theta: Vector
    """The value of each of the estimator's `names`, b and k first."""
    std: Vector
    """Their standard deviations; NaN for a method that has none."""
    held: bool
    """Whether the estimate is held. It is False before a step, which may set it."""


below = tuple(tuple(range(n)) for n in range(65))
"""`below[n]` is (0, 1, ..., n - 1), for n to 64: a `range(n)` that need not be made anew.

Compiled, it is `range(n)`.
"""


def zeros(m: int) -> Vector:
    """A vector of zeros."""
    return [0.0] * m


def diagonal(values: Sequence[float]) -> Matrix:
    """A matrix with these values on its diagonal."""
    return [
        [value if i == j else 0.0 for j in range(len(values))] for i, value in enumerate(values)
    ]
