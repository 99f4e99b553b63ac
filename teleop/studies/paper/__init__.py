"""Reproduce Table I and the figures of the paper (Yamamoto et al., BioRob 2008) in simulation."""
