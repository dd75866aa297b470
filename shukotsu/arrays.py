"""Types of arrays by what they hold, of any shape."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]
Index = Integers
"""Integers that select elements of another array."""
