"""The drive supply's firmware."""
