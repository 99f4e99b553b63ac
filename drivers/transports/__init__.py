"""Send and receive bytes and frames on serial ports, CAN buses and networks."""
