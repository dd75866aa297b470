"""Axes of the pictures that compare models, chosen so that a gross failure flattens no other number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_GROSS = 8.0
"""The largest number being so many times the usual one, an even scale would squeeze all others together."""
_DECADES = 4.0
"""The most powers of ten that a logarithmic axis spans; what is smaller stands at its foot."""
_MARGIN = 0.06
"""The share of an axis of differences that is kept free at either end."""


@dataclass(frozen=True)
class Axis:
    """A horizontal scale from `low` to `high`; `kind` is linear, log or asinh (even within +-`even`)."""

    low: float
    high: float
    kind: str
    even: float = 1.0

    def place(self, values: Array) -> Array:
        """Shares 0 to 1 of the axis for values (n,); what is off the axis stands at its end."""
        clipped = np.clip(np.asarray(values, float), self.low, self.high)
        low, high = self._bent(np.array([self.low, self.high]))
        return np.asarray((self._bent(clipped) - low) / (high - low))

    def below(self, values: Array) -> int:
        """How many values are below a logarithmic axis."""
        return int((np.asarray(values) < self.low).sum()) if self.kind == "log" else 0

    def ticks(self, gap: float) -> list[float]:
        """Where the axis has numbers, from left to right, at least `gap` (a share of the axis) apart."""
        if self.kind == "linear":
            return _even_ticks(self.low, self.high, gap)
        powers = range(math.floor(math.log10(self.even)) - 1, math.ceil(math.log10(self.high)) + 1)
        sizes = [10.0**power for power in powers] + [3.0 * 10.0**power for power in powers]
        if self.kind == "log":
            wanted = [size for size in sizes if self.low * 0.999 <= size <= self.high * 1.001]
            return sorted(self._apart(wanted or [self.low, self.high], gap))
        far = sorted((size for size in sizes if size >= self.even * 0.999), key=lambda s: (_is_three(s), -s))
        wanted = [0.0, *(sign * size for size in far for sign in (-1, 1))]
        return sorted(self._apart([size for size in wanted if self.low <= size <= self.high], gap))

    def _apart(self, wanted: Sequence[float], gap: float) -> list[float]:
        """Those of the wanted ticks, the first of them first, that leave room between each other."""
        kept: list[float] = []
        for tick in wanted:
            places = self.place(np.array([tick, *kept]))
            if (np.abs(places[1:] - places[0]) >= gap).all():
                kept.append(tick)
        return kept

    def _bent(self, values: Array) -> Array:
        if self.kind == "log":
            return np.asarray(np.log(values))
        return np.asarray(np.arcsinh(values / self.even)) if self.kind == "asinh" else values


def value_axis(values: Array) -> Axis:
    """An axis for errors (n,), none below 0: from 0, or logarithmic where the largest dwarfs the usual."""
    highest, usual = float(values.max(initial=0.0)), float(np.median(values)) if len(values) else 0.0
    if highest <= 0.0:
        return Axis(0.0, 1.0, "linear")
    if highest <= _GROSS * usual:
        return Axis(0.0, highest * 1.04, "linear")
    lowest = max(float(values[values > 0].min()), highest / 10.0**_DECADES)
    return Axis(lowest / 1.1, highest * 1.1, "log", lowest)


def difference_axis(values: Array) -> Axis:
    """An axis for differences (n,) with 0 on it: even, or even about 0 and squeezed outward."""
    sizes = np.abs(values)
    largest = float(sizes.max(initial=0.0))
    if largest <= 0.0:
        return Axis(-1.0, 1.0, "linear")
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    usual = float(np.median(sizes[sizes > largest * 1e-6]))
    if largest <= _GROSS * usual:
        pad = _MARGIN * (high - low)
        return Axis(low - pad, high + pad, "linear")
    even = _nice_below(max(usual, largest / 10.0**_DECADES))
    ends = np.arcsinh(np.array([low, high]) / even)
    pad = _MARGIN * float(ends[1] - ends[0])
    low, high = (even * math.sinh(float(end)) for end in (ends[0] - pad, ends[1] + pad))
    return Axis(low, high, "asinh", even)


def _even_ticks(low: float, high: float, gap: float) -> list[float]:
    rough = (high - low) * gap
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough * 0.999)
    return [n * step for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def _nice_below(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (5.0, 2.0, 1.0) if m * power <= value * 1.001)


def _is_three(size: float) -> bool:
    return not math.log10(size).is_integer() and abs(math.log10(size) % 1 - math.log10(3)) < 1e-6
