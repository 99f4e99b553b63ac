"""Online estimators. Each file contains one estimator, or functions that several estimators use."""
