"""The sampling bridge's firmware."""
