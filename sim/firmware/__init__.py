"""Firmware of the simulated devices: what answers at the other end of the wire, a folder a device."""
