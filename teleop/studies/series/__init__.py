"""Run a series of trials: read the plan, order the trials, keep a journal, write the results."""
