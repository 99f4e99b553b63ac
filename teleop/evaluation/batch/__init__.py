"""Evaluate all samples of a record together: phases, models of the contact, k and b to publish."""
