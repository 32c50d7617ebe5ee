"""A sampling oscilloscope as a second source of waveforms: USBTMC and SCPI."""
