"""Files of others: point files that are read, exports that are written."""
