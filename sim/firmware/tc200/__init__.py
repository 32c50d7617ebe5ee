"""The TC200's firmware."""
