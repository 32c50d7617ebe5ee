"""Random numbers by name: one root seed, one stream for each source of noise.

Adding a source never shifts another, and a number depends on the measurement (run, repetition, record), not
on when, how fast or in which blocks it is computed.
"""

from __future__ import annotations

import struct
from functools import lru_cache
from hashlib import blake2b

import numpy as np
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import DTypeLike, NDArray


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
        self._source = lru_cache(maxsize=256)(self._hash_of_source)

    def stream(self, name: str, *key: int) -> np.random.Generator:
        """Make the generator of the source ``name`` for one measurement.

        A record needs several streams, so that making one has to be cheap: the state is a hash (BLAKE2b, RFC 7693) of
        seed, name and key, which takes a quarter of the time of numpy's `SeedSequence`.

        Parameters
        ----------
        name : str
            Name of the noise source, for example ``"receiver.amplifier"``.
        *key : int
            The measurement, for example run id, repetition and record number.
        """
        digest = self._source(name).copy()
        digest.update(struct.pack(f"<{len(key)}q", *key))
        words = _Words(digest.digest())
        return np.random.Generator(np.random.SFC64(words))  # type: ignore[arg-type]  # numpy's stubs lack ISeedSequence

    def _hash_of_source(self, name: str) -> blake2b:
        return blake2b(f"{self.seed} {name} ".encode())


class _Words(ISeedSequence):
    """Hands the words of a hash to a bit generator."""

    def __init__(self, digest: bytes) -> None:
        self._digest = digest

    def generate_state(self, n_words: int, dtype: DTypeLike = np.uint32) -> NDArray[np.uint32 | np.uint64]:
        """Get the first words of the digest."""
        return np.frombuffer(self._digest, dtype=dtype, count=n_words)
