"""Run the online estimators over the samples of a record."""
