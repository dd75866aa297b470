"""Finding records in a stream without checksums: from start to start, and back into step after damage.

A start is a place where a header stands that can be one. It is believed when it follows directly on a good
record, when right at its end stands another start, or when its numbers prove it. So garbage between records
costs nothing, and a byte that is lost or changed costs the record that it was in and no other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

Wholes = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Starts:
    """N places in a piece of a stream where a record or reply may start.

    at, end : (N,) its first byte and the first after it; ascending by `at`.
    following : (N,) index of the start that stands right at its end; -1 where none does.
    """

    at: Wholes
    end: Wholes
    following: Wholes


@dataclass
class Walked:
    """What a walk decided.

    accepted : indices of starts, ascending. skipped : stretches (first byte, first after).
    position : all before it is decided. trusted : whether a record that starts there is believed.
    """

    position: int
    trusted: bool
    runs: list[Wholes] = field(default_factory=list)
    skipped: list[tuple[int, int]] = field(default_factory=list)

    @property
    def accepted(self) -> Wholes:
        """Indices of the accepted starts, shape (M,)."""
        return np.concatenate(self.runs) if self.runs else np.empty(0, np.int64)

    def accept(self, first: int, last: int, position: int) -> None:
        """Accept the starts first..last, which end at `position`."""
        self.runs.append(np.arange(first, last + 1))
        self.position = position

    def skip_to(self, position: int) -> None:
        """Skip the bytes up to `position`."""
        if position > self.position:
            self.skipped.append((self.position, position))
        self.position = position


def starts_of(at: Wholes, end: Wholes) -> Starts:
    """Link the places: of each, which one stands at its end. at, end : (N,), ascending by at."""
    following = np.searchsorted(at, end)
    inside = following < len(at)
    stands = np.zeros(len(at), bool)
    stands[inside] = at[following[inside]] == end[inside]
    return Starts(at, end, np.where(stands, following, -1))


@dataclass(frozen=True)
class Stream:
    """A piece of a stream of `length` bytes with its starts.

    final : nothing follows the piece. header_bytes, longest_bytes : of a header, and of the longest record.
    doubtful(indices) : whether the numbers of those starts, shape (M,), cannot be right (or are cut off).
    provable(indices) : whether numbers that can be right prove the start: chance would hardly make them.
    """

    starts: Starts
    length: int
    final: bool
    header_bytes: int
    longest_bytes: int
    doubtful: Callable[[Wholes], Bools]
    provable: Callable[[Wholes], Bools]

    @cached_property
    def proved(self) -> Bools:
        """Whether right at a start's end stands another one, or the stream ends, shape (N,)."""
        ends = (self.starts.end == self.length) & self.final
        return np.asarray((self.starts.following >= 0) | ends)

    @cached_property
    def undecided(self) -> Bools:
        """Whether the piece is too short to say what stands at a start's end, shape (N,)."""
        return np.asarray((self.starts.end + self.header_bytes > self.length) & (not self.final))

    @cached_property
    def breaks(self) -> Wholes:
        """Starts that the next one in the list does not simply follow."""
        return np.flatnonzero(self.starts.following != np.arange(1, len(self.starts.at) + 1))

    @cached_property
    def believable(self) -> Wholes:
        """Starts that may be believed, or are undecided, though nothing good stands before them."""
        believable = self.proved | self.undecided
        others = np.flatnonzero(~believable & (self.starts.end <= self.length))
        others = others[self.provable(others)]
        believable[others[~self.doubtful(others)]] = True
        return np.flatnonzero(believable)


def walk(stream: Stream, *, trusted: bool) -> Walked:
    """Walk over a piece of a stream; trusted: a record that starts at its byte 0 is believed.

    What the piece is too short to decide is left for the next one, so that the outcome does not depend on
    where a stream is cut.
    """
    walked = Walked(0, trusted)
    starts = stream.starts
    while walked.position < stream.length:
        index = int(np.searchsorted(starts.at, walked.position))
        if walked.trusted and index < len(starts.at) and starts.at[index] == walked.position:
            last = int(stream.breaks[np.searchsorted(stream.breaks, index)])
            if last > index:
                walked.accept(index, last - 1, int(starts.at[last]))
            if not _judge(walked, stream, last):
                break
        elif not _search(walked, stream, index):
            break
    return walked


def _judge(walked: Walked, stream: Stream, index: int) -> bool:
    """Decide on a believed start that the next in the list does not simply follow; False to wait for more."""
    at, end = int(stream.starts.at[index]), int(stream.starts.end[index])
    if stream.proved[index]:
        walked.accept(index, index, end)
        return True
    if not stream.final and stream.length < end + stream.header_bytes + stream.longest_bytes:
        return False
    inside = slice(index + 1, int(np.searchsorted(stream.starts.at, end)))
    within = np.flatnonzero(stream.proved[inside])
    walked.trusted = len(within) > 0
    if len(within):  # the next record starts before this one's end: bytes of this one are missing
        walked.skip_to(int(stream.starts.at[index + 1 + within[0]]))
    elif end > stream.length or stream.doubtful(np.array([index]))[0]:
        walked.skip_to(at + 1)
    else:  # all of it is there; what follows is garbage, or a record whose header is damaged
        walked.accept(index, index, end)
    return True


def _search(walked: Walked, stream: Stream, index: int) -> bool:
    """Skip to the next start that can be believed; False to wait for more."""
    walked.trusted = False
    nth = int(np.searchsorted(stream.believable, index))
    if nth == len(stream.believable):
        # The first bytes of a header may stand at the very end.
        rest = 0 if stream.final else stream.header_bytes - 1
        walked.skip_to(max(walked.position, stream.length - rest))
        return False
    chosen = int(stream.believable[nth])
    walked.skip_to(int(stream.starts.at[chosen]))
    walked.trusted = not stream.undecided[chosen]
    return walked.trusted
