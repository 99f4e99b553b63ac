"""Define the form of a step: the function with which an estimation method processes one sample.

A step is a function

    step(parameters, state, phi, f, dt)

A sample consists of the regressors `phi` = (v, x, ...), the force `f` [N] and the time `dt` since
the previous sample [s]. The step reads `parameters` and updates `state` in place. `parameters` and
`state` are dataclasses whose fields have a name, a type and a description:

    @dataclass(frozen=True, slots=True)
    class RlsParameters:
        beta: float             # forgetting factor

    @dataclass(slots=True)
    class RlsState(State):      # `State` has the fields theta, std and held
        P: Matrix               # covariance, (m, m)
        noise: float            # variance of the noise [N^2]

    def step(parameters, state, phi, f, dt):
        P = state.P
        for i in below[len(phi)]:
            ... P[i][j] ...
        state.noise += ...

Here `below[n]` is the tuple (0, 1, ..., n - 1). A field is a float, an int, a bool, a `Vector`, a
`Matrix`, or another such dataclass. The shape of a vector or a matrix is that of its initial value
and does not change.

The same source code is run in two ways. The results are identical to the bit:

- interpreted, in the live loop: vectors are lists and matrices are lists of lists;
- compiled by numba, for arrays of samples. The state is one numpy record with the same field names.
  Vectors and matrices are views of this record, and `phi` is a tuple (`estimation/compiled.py`).

So a step may use only what both Python and numba support: arithmetic, comparisons, `math`, loops,
and calls of functions that follow the same rules. There are three rules:

- change vectors and matrices element by element, `P[i][j] = ...`, and never replace them;
- for every possible sample, never divide by zero, and never take the root or the logarithm of a
  number for which it is undefined. In these cases Python raises an error, but compiled code
  continues with inf or nan;
- write loops over regressors as `for i in below[m]`. `for i in range(m)` is also correct, but takes
  twice the time in interpreted code.

The state is a record with named fields for two reasons. The first reason is that a step can assign
to a scalar field of a record, but not to a field of a NamedTuple. The second reason is speed. The
time of one sample in recursive least squares, including the confidence interval, was measured:

- compiled: 30 ns with a record, 125 ns with a flat list of numbers, and 350 ns with a NamedTuple of
  separate arrays;
- interpreted: 2.6 us with a record, and 2.8 us with a flat list of numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

Vector = list[float]
"""Vector of shape (m,)."""
Matrix = list[list[float]]
"""Matrix of shape (m, n), a list of rows."""
Regressors = Sequence[float]
"""Regressors phi = (v, x, ...) of one sample: v in m/s, x in m."""
Step = Callable[[Any, Any, Regressors, float, float], None]
"""Function (parameters, state, phi, f, dt) that processes one sample."""

B, K = 0, 1
"""Indices of damping and stiffness in `theta`, `std` and the regressors."""


@dataclass(slots=True)
class State:
    """Variables that the step of a method updates at each sample.

    This class is the base class for all methods. It contains only the estimate. A method adds its
    further variables in a subclass.
    """

    theta: Vector
    """Estimated values, in the order of the estimator's `names`, b and k first, shape (m,)."""
    std: Vector
    """Standard deviations of `theta`, shape (m,); NaN if the method does not compute them."""
    held: bool
    """True if the latest sample did not change `theta`. The caller of a step first sets `held` to
    False. The step may set it to True."""


below = tuple(tuple(range(n)) for n in range(65))
"""`below[n]` is the tuple (0, 1, ..., n - 1), for n <= 64. In compiled code it is `range(n)`."""


def zeros(m: int) -> Vector:
    """Return a vector of m zeros."""
    return [0.0] * m


def diagonal(values: Sequence[float]) -> Matrix:
    """Return a square matrix with these values on its diagonal, and zeros elsewhere."""
    return [
        [value if i == j else 0.0 for j in range(len(values))] for i, value in enumerate(values)
    ]
