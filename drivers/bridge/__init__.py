"""The sampling bridge: records and windows over USB, its gate and its watchdog (SBP)."""
