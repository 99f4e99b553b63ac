"""Reproduction of the paper's Table I and figures, with an analysis of the results."""
