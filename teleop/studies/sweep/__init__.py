"""Run sweeps: many trials or evaluations with different settings, in parallel."""
