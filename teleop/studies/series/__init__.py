"""Series of trials: plan, order of the trials, journal of the trials that were run, and results."""
