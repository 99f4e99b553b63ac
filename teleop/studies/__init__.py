"""Run studies, which consist of many trials: the trials of the paper, series and sweeps."""
