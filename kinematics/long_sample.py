"""Statistics of a sample that may be too long for memory: exact, and the same however it came in parts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from tempfile import SpooledTemporaryFile

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array

PIECE = 1 << 18
"""Numbers that are summed at once, as NumPy does; sums of pieces are added up in order."""

_SIGN = np.uint64(1 << 63)
_DIGIT_BITS = 16


class LongSample:
    """Numbers in the order in which they were added: few in memory, many in a temporary file.

    piece : how many are held in memory. Statistics raise ValueError where there is no number.
    """

    def __init__(self, piece: int = PIECE) -> None:
        self._file = SpooledTemporaryFile(max_size=8 * piece)  # noqa: SIM115 - it lives as long as the sample
        self._piece = piece
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, values: Array) -> None:
        """Add numbers (N,)."""
        self._file.seek(0, os.SEEK_END)
        self._file.write(np.ascontiguousarray(values, float).data)
        self._count += len(values)

    def add_known(self, values: Array) -> None:
        """Add those of the numbers (N,) that are finite."""
        self.add(values[np.isfinite(values)])

    def pieces(self, size: int | None = None) -> Iterator[Array]:
        """Give the numbers again, so many at a time; the last ones may be fewer."""
        step = 8 * (size or self._piece)
        for start in range(0, 8 * self._count, step):
            self._file.seek(start)
            yield np.frombuffer(self._file.read(step))

    def mean(self) -> float:
        """Give the arithmetic mean."""
        return float(sum(piece.sum() for piece in self.pieces()) / self._some())

    def sd(self) -> float:
        """Give the standard deviation, divided by n."""
        mean = self.mean()
        return float(np.sqrt(sum(((piece - mean) ** 2).sum() for piece in self.pieces()) / self._some()))

    def extremes(self) -> tuple[float, float]:
        """Give the least and the largest number."""
        self._some()
        ends = [(piece.min(), piece.max()) for piece in self.pieces()]
        return float(min(low for low, _ in ends)), float(max(high for _, high in ends))

    def circular_mean_rad(self) -> float:
        """Give the mean direction of angles in radians."""
        return float(np.angle(sum(np.exp(1j * piece).sum() for piece in self.pieces()) / self._some()))

    def median(self) -> float:
        """Give the median, of an even count the mean of the two in the middle."""
        if self._some() <= self._piece:
            return float(np.median(next(self.pieces())))
        low, high = (self._ranked(rank) for rank in ((self._count - 1) // 2, self._count // 2))
        return float(np.mean([low, high]))

    def percentile(self, percent: float) -> float:
        """Give a percentile, interpolated as NumPy does by default."""
        if self._some() <= self._piece:
            return float(np.percentile(next(self.pieces()), percent))
        place = percent / 100 * (self._count - 1)
        rank = int(place)
        low = self._ranked(rank)
        high = self._ranked(min(rank + 1, self._count - 1))
        share = place - rank  # from the nearer end, so that nothing lies beyond either
        return low + (high - low) * share if share < 0.5 else high - (high - low) * (1 - share)

    def _some(self) -> int:
        if not self._count:
            raise ValueError("a sample without numbers has no statistics")
        return self._count

    def _ranked(self, rank: int) -> float:
        """The number that so many lie before in ascending order: its 64 bits, 16 a pass, by counting."""
        found = 0
        for shift in range(64 - _DIGIT_BITS, -1, -_DIGIT_BITS):
            counts = np.zeros(1 << _DIGIT_BITS, np.int64)
            for piece in self.pieces():
                digits = _ordered_bits(piece) >> np.uint64(shift)
                above = digits >> np.uint64(_DIGIT_BITS)
                own = digits[above == found] & np.uint64((1 << _DIGIT_BITS) - 1)
                counts += np.bincount(own.astype(np.int64), minlength=len(counts))
            before = np.cumsum(counts)
            digit = int(np.searchsorted(before, rank, side="right"))
            rank -= int(before[digit] - counts[digit])
            found = found << _DIGIT_BITS | digit
        return _number(found)


def _ordered_bits(values: Array) -> npt.NDArray[np.uint64]:
    """Whole numbers (N,) in the order of the numbers (N,): the bits of a negative one are turned over."""
    bits = values.view(np.uint64)
    return np.asarray(np.where(values.view(np.int64) < 0, ~bits, bits | _SIGN))


def _number(bits: int) -> float:
    sign = int(_SIGN)
    own = bits ^ sign if bits & sign else bits ^ ((1 << 64) - 1)
    return float(np.array([own], np.uint64).view(float)[0])
