"""Control a 1-DOF telemanipulator, and estimate stiffness and damping of the touched specimen."""
