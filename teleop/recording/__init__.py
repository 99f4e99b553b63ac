"""Write and read recordings of trials, which are MCAP files with one message per tick."""
