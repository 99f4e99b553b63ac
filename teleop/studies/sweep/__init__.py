"""Sweeps: many trials or evaluations with different settings, which run in parallel."""
