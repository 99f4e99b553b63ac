"""Series of trials: a plan, its order, the journal of what was run, and a table of the results."""
