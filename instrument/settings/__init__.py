"""Settings of a bench: tables with units and ranges, profiles to start from."""
