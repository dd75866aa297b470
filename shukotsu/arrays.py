"""Types of arrays by element type; an annotation such as `Float[Array, "T 3"]` also states a shape.

The tests check stated shapes.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]
Index = Integers
"""Integers that select elements of another array."""

if TYPE_CHECKING or "jaxtyping" in sys.modules:  # only tests import it, because it is slow
    from jaxtyping import Bool, Float, Int
else:  # annotations are not evaluated
    Bool = Float = Int = None

__all__ = ["Array", "Bool", "Bools", "Float", "Index", "Int", "Integers"]
