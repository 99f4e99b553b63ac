"""Emulated devices and adapters, with the same protocols as the real ones, byte by byte."""
