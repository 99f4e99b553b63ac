"""Evaluate the steps of a protocol: relaxation, creep, and complex stiffness."""
