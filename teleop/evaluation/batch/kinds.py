"""Define the kinds of stiffness and damping, such as tangent stiffness and average stiffness.

Values of different kinds are different physical quantities. Therefore, they are neither averaged
nor compared.
"""

from __future__ import annotations

from collections.abc import Iterable

TANGENT = "tangent"
"""Kind of the stiffness of a result: the tangent at half of the force range."""
STORAGE = "k'"
"""Kind of the stiffness of a result: the storage stiffness at the frequency of a sine. The specimen
is in contact throughout, and its force is linear in the motion."""
AVERAGE = "average"
"""Kind of the stiffness and the damping of an estimator. The stiffness is the slope of the force
against the displacement from the datum. The damping is the slope of the force against the velocity.
Both are averages over the record."""
LOSS = "k''/omega"
"""Kind of the damping of a result: the equivalent viscous damping at the frequency of the motion.
It describes the whole energy that is lost in a cycle."""
BESIDES_RELAXATION = "besides relaxation"
"""Kind of the damping of a result: the derivative of the force to the velocity at the depth of k,
in a model that also contains relaxing parts (forces that decay with time constants), friction, or
damping that depends on the depth."""
WITH = f"{AVERAGE} with "
"""First words of the kind for an estimator whose model has further parameters. The names of these
parameters follow, for example `average with k3`."""
FURTHER_MEANING = {
    "f0": "f = b v + k x + f0",
    "m": "f = b v + k x + m a, with the acceleration a",
    "k3": "f = b v + k x + k3 x^3, in which k is the stiffness at the datum",
    "tau": "f + tau f' = b v + k x, in which k is the stiffness in slow motion",
}
"""Model of the estimators that have a parameter besides k and b, by the name of this parameter."""
MEANING = {
    LOSS: "the equivalent viscous damping k''/omega at the frequency of the motion",
    BESIDES_RELAXATION: "the damping besides relaxation and friction, at the depth of k; "
    "relaxation that is faster than the time constants counts as damping",
}
"""Description of the kinds of damping of a result."""
MEANING_OF_K = {
    TANGENT: "the tangent stiffness at the middle of the force range",
    STORAGE: "the storage stiffness k' at the frequency of a sine",
}
"""Description of the kinds of stiffness of a result."""


def kinds_of_estimates(further: Iterable[str]) -> dict[str, str]:
    """Return labels that state what k, b and e_f of an estimator mean, such as "average with k3".

    Values with different labels are different physical quantities and must not be compared. The
    label of k and b depends on the model of the estimator. The label of the force error e_f is the
    empty text for all estimators.
    """
    names = ", ".join(further)
    kind = f"{WITH}{names}" if names else AVERAGE
    return {"k": kind, "b": kind, "e_f": ""}
