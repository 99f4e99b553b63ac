"""Check, tare and emulate a rig before a trial, and measure the lag of its force channel."""
