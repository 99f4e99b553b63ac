"""Display of a trial while it runs: progress line and terminal."""
