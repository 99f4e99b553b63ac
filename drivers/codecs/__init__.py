"""Convert the frames of devices to values, and values to frames. Each file is for one protocol."""
