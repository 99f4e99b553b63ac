"""Studies: series of trials that are run and evaluated together."""
