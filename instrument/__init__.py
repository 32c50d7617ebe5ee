"""What an operator runs: controller, scan, ranging, calibration, bench procedures, recording, command line."""
