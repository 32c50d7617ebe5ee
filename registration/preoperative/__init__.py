"""From a volume to surface points of the bone."""
