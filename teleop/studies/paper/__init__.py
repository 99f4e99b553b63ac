"""Reproduction of Table I and the figures of the paper, with an analysis of the results."""
