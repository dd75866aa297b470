"""Scales of pictures: even, logarithmic where a gross failure dwarfs the rest, or squeezed outward from 0."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """A scale from `low` to `high`; `kind` is linear, log or asinh (even within +-`even`)."""

    low: float
    high: float
    kind: str = "linear"
    even: float = 1.0

    def share(self, values: npt.ArrayLike) -> Array:
        """Where values are: 0 at the low end, 1 at the high end; those off the scale are beyond."""
        low, high = self._even(self.low), self._even(self.high)
        return np.asarray((self._even(np.asarray(values, float)) - low) / (high - low))

    def below(self, values: Array) -> int:
        """How many values are below a logarithmic scale."""
        return int((np.asarray(values) < self.low).sum()) if self.kind == "log" else 0

    def ticks(self, most: int = 5, apart: float = 0.12) -> list[float]:
        """Round numbers on the scale, in order: of an even one at most one more than `most`, of another one
        as many as stand `apart` at least, as a share of the scale.
        """
        if self.kind == "linear":
            return _even_steps(self.low, self.high, most)
        ticks: list[float] = []
        for steps in ((1, 2, 5), (1, 3), (1,)):
            sizes = _round_numbers(self.high / 1e6, max(-self.low, self.high), steps)
            sides = [] if self.kind == "log" else [0.0, *(-size for size in sizes)]
            ticks = sorted(tick for tick in (*sides, *sizes) if self.low <= tick <= self.high)
            from_zero = np.abs(self.share(ticks) - self.share(0.0))
            if self.kind == "asinh":
                ticks = [n for n, gap in zip(ticks, from_zero, strict=True) if gap > apart or n == 0.0]
            if np.diff(self.share(ticks)).min(initial=1.0) > apart:
                break
        return ticks

    def _even(self, values: npt.ArrayLike) -> Array:
        if self.kind == "log":
            return np.asarray(np.log10(np.maximum(values, 1e-300)))
        return np.asarray(np.arcsinh(np.asarray(values) / self.even) if self.kind == "asinh" else values)


def plain(value: float) -> str:
    """A number without trailing zeros, with a true minus sign."""
    return f"{round(value, 9) + 0.0:g}".replace("-", "−")


def _round_numbers(low: float, high: float, steps: tuple[int, ...]) -> list[float]:
    """The steps times powers of ten, from `low` to `high`, both above 0."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [n for decade in decades for step in steps if low <= (n := float(f"{step}e{decade}")) <= high]


def _even_steps(low: float, high: float, most: int) -> list[float]:
    decade = 10.0 ** math.floor(math.log10((high - low) / most))
    ticks: list[float] = []
    for step in (decade * size for size in (1, 2, 5, 10)):
        ticks = [n * step for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
        if len(ticks) <= most + 1:
            break
    return ticks
