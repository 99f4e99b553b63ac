"""A trial: settings, assembly of its parts, the loop, the run."""
