"""Force-feedback laws, one file for each law, with energy tank, energy observers and stability."""
