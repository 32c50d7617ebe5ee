"""What a bench procedure works with: the radar, a stage, raw readings, the outcome and its folder."""
