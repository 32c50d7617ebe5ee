"""The physics of the radar and of what it looks at, from first principles; shares no formula with the instrument."""
