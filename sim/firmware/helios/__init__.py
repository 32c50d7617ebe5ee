"""The galvo controller's firmware."""
