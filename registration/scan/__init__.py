"""The scan that is registered: points and beams, raster neighbours, noise, response, bone or tissue."""
