"""Read the samples of measurement files and recordings, in blocks or as arrays."""
