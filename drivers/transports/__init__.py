"""Send and receive bytes and frames on serial ports and CAN buses."""
