"""The global search: where starts come from, how they are thinned out by successive halving, and which minima remain."""
