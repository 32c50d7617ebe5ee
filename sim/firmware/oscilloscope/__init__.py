"""The oscilloscope's firmware: USBTMC, SCPI, waveforms."""
