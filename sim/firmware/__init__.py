"""Firmware of the simulated devices, one folder per device."""
