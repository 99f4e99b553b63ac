"""Controller for a 1-DOF telemanipulator that estimates stiffness and damping of a specimen."""
