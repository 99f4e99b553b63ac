"""Force-feedback laws, one per file, and the energy tank and the energy observers of the laws."""
