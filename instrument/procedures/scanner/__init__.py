"""Bench procedure `scanner`: settling and step response of the mirrors."""
