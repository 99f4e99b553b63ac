"""Hardware-in-the-loop controller for a 1-DOF telemanipulator that estimates what it touches."""
