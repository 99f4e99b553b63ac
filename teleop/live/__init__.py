"""Display on the terminal while a trial runs: the progress line."""
