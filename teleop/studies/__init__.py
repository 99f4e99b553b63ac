"""Run studies of many trials: trials of the paper, planned series, and sweeps of settings."""
