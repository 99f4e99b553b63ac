"""Write and read recordings of trials: MCAP files with one message per tick."""
