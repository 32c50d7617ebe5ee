"""Random numbers by name: one root seed, one stream for each source of noise.

Adding a source never shifts another, and a number depends on what is measured (run, repetition, record),
not on when, how fast or in which blocks it was computed.
"""

from __future__ import annotations

import zlib

import numpy as np


class Noise:
    """All streams of one simulated bench.

    Parameters
    ----------
    seed : int
        Root seed, 0 or greater.
    """

    def __init__(self, seed: int) -> None:
        if seed < 0:
            raise ValueError(f"seed must be 0 or greater, not {seed}")
        self.seed = seed

    def stream(self, name: str, *key: int) -> np.random.Generator:
        """Make the generator of the source ``name`` for one measurement.

        Parameters
        ----------
        name : str
            Name of the noise source, for example ``"receiver.amplifier"``.
        *key : int
            What is measured, for example run id, repetition and record number.
        """
        sequence = np.random.SeedSequence([self.seed, zlib.crc32(name.encode())], spawn_key=key)
        return np.random.Generator(np.random.SFC64(sequence))
