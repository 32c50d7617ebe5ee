"""The exact fit of a pose to the beams, along weak modes too, without the regions that are excluded."""
