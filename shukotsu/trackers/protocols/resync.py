"""Records in a stream without checksums: from start to start, and back into step after damage.

A start is a byte where a header stands that can be one. It is believed when it follows directly on a good
record, or when what stands behind it or its own numbers prove it (a family says how). So garbage between
records costs nothing, and a byte that is lost or changed costs the record that it was in and no other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from shukotsu.trackers.protocols.records import Bools, Wholes

Verdicts = npt.NDArray[np.int8]

NO, UNKNOWN, YES = 0, 1, 2
"""Whether a start is believed; UNKNOWN where more bytes are needed to say."""


@dataclass(frozen=True)
class Starts:
    """N bytes in a piece of a stream of `length` bytes where a record may start.

    at : (N,) ascending. record_bytes : of a record; header_bytes : of its header.
    final : nothing follows the piece.
    """

    at: Wholes
    record_bytes: int
    length: int
    header_bytes: int
    final: bool

    @cached_property
    def end(self) -> Wholes:
        """First byte after each record, shape (N,)."""
        return self.at + self.record_bytes

    @cached_property
    def following(self) -> Wholes:
        """Index of the start that stands right at a start's end; -1 where none does, shape (N,)."""
        index = np.searchsorted(self.at, self.end)
        return np.where(np.append(self.at, -1)[index] == self.end, index, -1)

    @cached_property
    def linked(self) -> Bools:
        """Whether right at a start's end stands another one, or the stream ends, shape (N,)."""
        return np.asarray((self.following >= 0) | ((self.end == self.length) & self.final))

    @cached_property
    def cut(self) -> Bools:
        """Whether the piece is too short to say what stands at a start's end, shape (N,)."""
        return np.asarray((self.end + self.header_bytes > self.length) & (not self.final))

    @cached_property
    def link_verdicts(self) -> Verdicts:
        """Whether a start is linked, shape (N,) of YES, UNKNOWN and NO."""
        return np.where(self.linked, YES, np.where(self.cut, UNKNOWN, NO)).astype(np.int8)


@dataclass
class Walk:
    """What was decided on a piece of a stream.

    position : all before it is decided. trusted : whether a record that starts there is believed.
    """

    position: int
    trusted: bool
    _runs: list[Wholes] = field(default_factory=lambda: [np.empty(0, np.int64)])

    @property
    def accepted(self) -> Wholes:
        """Indices of the accepted starts, ascending, shape (M,)."""
        return np.concatenate(self._runs)

    def accept(self, first: int, last: int, position: int) -> None:
        """Accept the starts first..last, which end at `position`."""
        self._runs.append(np.arange(first, last + 1))
        self.position = position


def walk(starts: Starts, believed: Verdicts, is_good: Callable[[int], bool], *, trusted: bool) -> Walk:
    """Walk over a piece of a stream.

    believed : (N,) whether a start is believed though nothing good stands before it. is_good(index) : whether
    the record at a start is all there and its numbers can be right. trusted : whether a record that starts at
    byte 0 is believed.

    What the piece is too short to decide is left for the next one, so that the outcome does not depend on
    where a stream is cut.
    """
    decided = Walk(0, trusted)
    breaks = np.flatnonzero(starts.following != np.arange(1, len(starts.at) + 1))
    believable = np.flatnonzero(believed)
    # Where less than a header is left nothing is decided, not even that no record starts there.
    shortest = 1 if starts.final else starts.header_bytes
    while decided.position + shortest <= starts.length:
        index = int(np.searchsorted(starts.at, decided.position))
        if decided.trusted and index < len(starts.at) and starts.at[index] == decided.position:
            last = int(breaks[np.searchsorted(breaks, index)])
            if last > index:
                decided.accept(index, last - 1, int(starts.at[last]))
            if not _judge(decided, starts, believed, is_good, last):
                break
        elif not _search(decided, starts, believed, believable, index):
            break
    return decided


def _judge(
    decided: Walk, starts: Starts, believed: Verdicts, is_good: Callable[[int], bool], index: int
) -> bool:
    """Decide on a trusted start that the next in the list does not simply follow; False to wait for more."""
    at, end = int(starts.at[index]), int(starts.end[index])
    if starts.linked[index]:
        decided.accept(index, index, end)
        return True
    if starts.cut[index]:
        return False
    inside = slice(index + 1, int(np.searchsorted(starts.at, end)))
    within = np.flatnonzero(believed[inside]) + index + 1
    if len(within):  # the next record starts before this one's end: bytes of this one are missing
        if believed[within[0]] == UNKNOWN:
            return False
        decided.position = int(starts.at[within[0]])
    elif is_good(index):  # all of it is there; what follows is garbage, or a record whose header is damaged
        decided.accept(index, index, end)
        decided.trusted = False
    else:
        decided.position, decided.trusted = at + 1, False
    return True


def _search(decided: Walk, starts: Starts, believed: Verdicts, believable: Wholes, index: int) -> bool:
    """Skip to the next start that can be believed; False to wait for more."""
    decided.trusted = False
    nth = int(np.searchsorted(believable, index))
    if nth == len(believable):
        # The first bytes of a header may stand at the very end.
        rest = 0 if starts.final else starts.header_bytes - 1
        decided.position = max(decided.position, starts.length - rest)
        return False
    chosen = int(believable[nth])
    decided.position = int(starts.at[chosen])
    decided.trusted = bool(believed[chosen] == YES)
    return decided.trusted
