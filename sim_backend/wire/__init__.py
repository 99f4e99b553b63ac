"""Emulated devices and CAN adapters, which send and receive the same bytes as real ones."""
