"""Kinds of stiffness and damping.

Values of different kinds are different physical quantities: they are neither averaged nor compared.
"""

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
OF_ESTIMATES = {"k": AVERAGE, "b": AVERAGE, "e_f": ""}
"""Kind of each value of an estimator, by symbol. All force errors are of the same kind; the name of
this kind is empty."""
MEANING = {
    LOSS: "the equivalent viscous damping k''/omega at the frequency of the motion",
    BESIDES_RELAXATION: "the damping besides the parts that relax",
}
"""Description of the kinds of damping of a result."""
UNDETERMINED = 1e-200
"""If the interval of a quantity is narrower than this, the record does not determine the
quantity."""
