"""The delay generator's firmware."""
