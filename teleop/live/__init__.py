"""Show a running trial on the live page in a browser and in the progress line on the terminal."""
