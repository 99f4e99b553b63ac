"""Display of running trials: the live page in a browser, and the progress line on the terminal."""
