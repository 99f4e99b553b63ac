"""Readers of measurement files, one file for each format."""
