"""Links to the devices: serial ports by URL, USB and USBTMC, transcripts, retries, what to do when a port fails."""
