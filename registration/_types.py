"""Array types used throughout the package."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Neighbours = npt.NDArray[np.int32]
"""Indices (N, 8) of each point's neighbours; N stands for "none there"."""
