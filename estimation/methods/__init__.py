"""The online estimators. Each file contains one estimator or functions for several of them."""
