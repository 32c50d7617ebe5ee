"""The drive supply TDK-Lambda GEN600-1.3: voltage, output, interlock."""
