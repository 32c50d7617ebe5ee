"""The galvo controller Helios DAC: single positions and paths, over USB."""
