"""Compare and combine several recordings."""
