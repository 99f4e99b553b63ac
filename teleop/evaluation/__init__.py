"""Evaluate recordings of trials, and measurement files of other machines."""
