"""Run sweeps: many trials, or many evaluations of a recording, with different settings."""
