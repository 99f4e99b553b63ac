"""Kinds of stiffness and damping.

Values of different kinds are different physical quantities: they are neither averaged nor compared.
"""

from __future__ import annotations

from collections.abc import Iterable

TANGENT = "tangent"
"""Kind of the stiffness of a result: the tangent at half of the force range."""
AVERAGE = "average"
"""Kind of the stiffness and the damping of an estimator. The stiffness is the slope of the force
against the displacement from the datum, and the damping is its slope against the velocity. Both are
averages over the record."""
LOSS = "k''/omega"
"""Kind of the damping of a result: the equivalent viscous damping at the frequency of the motion.
It contains the whole loss of a cycle."""
BESIDES_RELAXATION = "besides relaxation"
"""Kind of the damping of a result: the coefficient of the velocity besides the relaxing parts."""
WITH = f"{AVERAGE} with "
"""Start of the kind of stiffness and damping of an estimator with further parameters, for example
`average with k3`."""
FURTHER_MEANING = {
    "f0": "f = b v + k x + f0",
    "m": "f = b v + k x + m a, with the acceleration a",
    "k3": "f = b v + k x + k3 x^3, in which k is the stiffness at the datum",
    "tau": "f + tau f' = b v + k x, in which k is the stiffness in slow motion",
}
"""Model of the estimators with a further parameter, by the name of the parameter."""
MEANING = {
    LOSS: "the equivalent viscous damping k''/omega at the frequency of the motion",
    BESIDES_RELAXATION: "the damping besides the parts that relax",
}
"""Description of the kinds of damping of a result."""
UNDETERMINED = 1e-200
"""If the interval of a quantity is narrower than this, the record does not determine the
quantity."""


def kinds_of_estimates(further: Iterable[str]) -> dict[str, str]:
    """Return the kind of each value of an estimator, by symbol.

    The result contains the kinds of k, b and the force error e_f. The force errors of all
    estimators are of the same kind. Its name is the empty string.

    Parameters
    ----------
    further
        Names of the parameters of the estimator's model besides b and k.
    """
    names = ", ".join(further)
    kind = f"{WITH}{names}" if names else AVERAGE
    return {"k": kind, "b": kind, "e_f": ""}
