"""Reproduce Table I and the figures of the paper, and analyse the results."""
