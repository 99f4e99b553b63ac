"""Read measurement files, with one module for each format."""
