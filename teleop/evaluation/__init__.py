"""Evaluate recordings, and measurement files of other machines."""
