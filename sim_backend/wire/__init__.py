"""The wire: emulated devices and adapters that speak byte for byte what the real ones do."""
