"""One module a device; links (serial, USB), clock and errors. Knows nothing of the rest of the house."""
