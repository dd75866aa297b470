"""Byte streams decoded piece by piece: pieces of any length in, undecided bytes kept for the next."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

import numpy as np

from shukotsu.trackers.protocols.records import Bytes, Decoded, Skipped, Wholes, concatenated

PIECE_BYTES = 1 << 18
"""Longer pieces are decoded in parts, so that the memory that decoding takes has a bound."""


class PiecewiseDecoder(ABC):
    """Turns a stream of bytes, given piece by piece, into records; keeps what it cannot decide yet.

    However the stream is cut into pieces, the records, skips and replies in total are the same. Decided is on
    whole buffers of at most PIECE_BYTES and a rest.
    """

    def __init__(self) -> None:
        self._rest = np.empty(0, np.uint8)
        self._offset = 0  # of the rest's first byte in the stream

    def feed(self, data: bytes | Bytes, *, final: bool = False) -> Decoded:
        """Decode the next piece; `final` says that nothing follows, so that the rest is decided too."""
        piece = data if isinstance(data, np.ndarray) else np.frombuffer(data, np.uint8)
        firsts = range(0, len(piece), PIECE_BYTES) or (0,)
        parts = [
            self._part(piece[first : first + PIECE_BYTES], final and first == firsts[-1]) for first in firsts
        ]
        return Decoded(
            concatenated([part.records for part in parts]),
            tuple(skip for part in parts for skip in part.skipped),
            tuple(reply for part in parts for reply in part.replies),
        )

    def _part(self, piece: Bytes, final: bool) -> Decoded:
        b = np.concatenate([self._rest, piece]) if len(self._rest) else piece
        decoded, decided = self._decide(b, final)
        first, self._offset = self._offset, self._offset + decided
        self._rest = b[decided:].copy()
        decoded.records.offset[:] += first
        return Decoded(
            decoded.records,
            tuple(replace(skip, offset=skip.offset + first) for skip in decoded.skipped),
            tuple(replace(reply, offset=reply.offset + first) for reply in decoded.replies),
        )

    @abstractmethod
    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        """Decode `b`; return what is in it, offsets counted in b, and how many of its bytes are decided.

        What more bytes could change is not decided yet, unless `final` says that none follow.
        """


def rows_at(b: Bytes, at: Wholes, size: int) -> Bytes:
    """The bytes of stretches of one size, (N, size); no copy where they stand one after the other."""
    if len(at) > 1 and (np.diff(at) == size).all():
        return b[at[0] : at[-1] + size].reshape(-1, size)
    return np.lib.stride_tricks.sliding_window_view(b, size)[at]


def gaps(first: Wholes, last: Wholes, length: int) -> tuple[Skipped, ...]:
    """Return the stretches of 0..length that none of the ascending, disjoint stretches first..last covers."""
    pairs = zip([0, *last.tolist()], [*first.tolist(), length], strict=True)
    return tuple(Skipped(start, end - start) for start, end in pairs if end > start)
