"""The delay generator SRS DG645: pulse repetition frequency, trigger on and off, amplitude and delays of its outputs."""
