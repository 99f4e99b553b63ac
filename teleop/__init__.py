"""Hardware-in-the-loop controller for a 1-DOF telemanipulator that estimates its environment."""
