"""Bench procedure `geometry`: the scanner's parameters from planes."""
