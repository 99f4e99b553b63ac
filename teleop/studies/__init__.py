"""Studies: series and sweeps, which consist of many trials that are evaluated together."""
