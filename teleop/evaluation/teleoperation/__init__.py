"""Evaluate what the person did and felt: tracking of a target, felt stiffness, oscillation."""
