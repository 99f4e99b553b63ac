"""Convert the frames (messages) of devices to values, and values to frames.

Each file contains the conversion for one communication protocol.
"""
