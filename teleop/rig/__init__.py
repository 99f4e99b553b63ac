"""Check or tare (zero) a rig, emulate its devices, and measure the lag of its force sensor."""
