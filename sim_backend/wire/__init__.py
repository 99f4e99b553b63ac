"""Emulated devices and adapters, which send and receive the same bytes as real devices."""
