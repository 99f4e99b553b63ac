"""Evaluation of recordings, and of measurement files from other machines."""
