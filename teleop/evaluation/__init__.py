"""Evaluation of recordings and of measurements from other machines."""
