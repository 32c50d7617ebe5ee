"""Bench procedure `prism`: accuracy on a body of known shape."""
