"""Emulated devices, one a file: the other end of each driver's wire."""
