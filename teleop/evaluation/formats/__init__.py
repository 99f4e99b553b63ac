"""Read measurement files. There is one module for each file format."""
