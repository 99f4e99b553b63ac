"""The recorder: what is kept of every tick, and the process that writes it to an MCAP file."""
