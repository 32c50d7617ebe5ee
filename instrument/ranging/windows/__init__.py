"""Windowed records: where windows go, which, and the ranges that come out of them."""
