"""Force-feedback laws, one file each, with their energy tank, observers and predictions."""
