"""What the columns of a table seem to be: time, frame, receiver, positions, orientations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from kinematics.rotations import Array

_NORM_SHARE = 0.9
_NORM_OFF = 0.02

_TIME = re.compile(r"time|stamp|^t$|^t_|sec", re.I)
_FRAME = re.compile(r"frame|sample|count|^index$|^n$|^#$", re.I)
_RECEIVER = re.compile(r"receiver|sensor|station|segment|marker|^id$|device|channel", re.I)
_ASIDE = re.compile(r"quality|error|dist(ortion)?$|button|stylus|sync|status|conf|flag|temp", re.I)
_ANGLE = re.compile(
    r"az|el(ev)?(ation)?\d*$|roll|pitch|yaw|euler|ori|rot|ang|att|psi|theta|phi|^r[xyz]", re.I
)


@dataclass(frozen=True)
class Roles:
    """What the columns, by title, seem to be.

    quaternions, matrices, angles, positions : groups of four, nine, three and three titles in the order of
    the table. aside : numbers that are none of these; text : columns that hold no numbers.
    """

    time: str | None = None
    frame: str | None = None
    receiver: str | None = None
    quaternions: list[list[str]] = field(default_factory=list)
    matrices: list[list[str]] = field(default_factory=list)
    angles: list[list[str]] = field(default_factory=list)
    positions: list[list[str]] = field(default_factory=list)
    aside: list[str] = field(default_factory=list)
    text: list[str] = field(default_factory=list)

    @property
    def orientations(self) -> tuple[str, list[list[str]]]:
        """The kind of orientation that there is most of, and its groups."""
        kinds = {"quaternion": self.quaternions, "matrix": self.matrices, "euler": self.angles}
        kind = max(kinds, key=lambda name: len(kinds[name]))
        return kind, kinds[kind]


def find_roles(titles: Sequence[str], numbers: Mapping[str, Array]) -> Roles:
    """Tell columns apart by their numbers and, where these leave it open, by their names.

    titles : all columns; numbers : those that hold numbers, title -> (N,).
    """
    numeric = [title for title in titles if title in numbers]
    time = next((t for t in numeric if _TIME.search(t) and _grows(numbers[t])), None)
    frame = next((t for t in numeric if t != time and _FRAME.search(t) and _whole(numbers[t])), None)
    receiver = next((t for t in titles if t not in (time, frame) and _is_receiver(t, numbers.get(t))), None)
    text = [title for title in titles if title not in numbers and title != receiver]
    left = [title for title in numeric if title not in (time, frame, receiver)]
    aside = [title for title in left if _ASIDE.search(title)]
    found = Roles(time, frame, receiver, aside=aside, text=text)
    run: list[str] = []
    free = [title for title in left if title not in aside]
    while free:
        size = next((n for n in (9, 4) if _is_rotation(free, numbers, n)), 0)
        if size:
            _sort_triples(run, numbers, found)
            run = []
            (found.matrices if size == 9 else found.quaternions).append(free[:size])
        else:
            run.append(free[0])
        free = free[size or 1 :]
    _sort_triples(run, numbers, found)
    return found


def _grows(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps) and (steps >= 0).all() and (steps > 0).any())


def _whole(values: Array) -> bool:
    return bool(_grows(values) and (values == np.floor(values)).all())


def _is_receiver(title: str, values: Array | None) -> bool:
    if not _RECEIVER.search(title):
        return False
    return values is None or (2 <= len(np.unique(values)) <= 64 and bool((values == np.floor(values)).all()))


def _is_rotation(free: Sequence[str], numbers: Mapping[str, Array], size: int) -> bool:
    """Whether the next columns are a rotation, and more nearly so than those that begin a little later.

    A small z in metres before a quaternion whose last number is small has norm 1 with its first three, too.
    """
    off = _off_rotation(free[:size], numbers, size)
    later = (_off_rotation(free[start : start + size], numbers, size) for start in range(1, size))
    return off < _NORM_OFF and off <= min(later)


def _off_rotation(titles: Sequence[str], numbers: Mapping[str, Array], size: int) -> float:
    """How far the columns are off norm 1 (four numbers) or a rotation (nine) in most rows; else infinite."""
    if len(titles) < size:
        return float("inf")
    rows = np.stack([numbers[title] for title in titles], -1)
    rows = rows[np.isfinite(rows).all(-1) & rows.any(-1)]
    if not len(rows):
        return float("inf")
    if size == 4:
        off = np.abs(np.linalg.norm(rows, axis=-1) - 1)
    else:
        m = rows.reshape(-1, 3, 3)
        off = np.abs(m @ np.swapaxes(m, 1, 2) - np.eye(3)).max((1, 2))
    return float(np.quantile(off, _NORM_SHARE))


def _sort_triples(run: Sequence[str], numbers: Mapping[str, Array], found: Roles) -> None:
    """Take columns by threes: angles by name; where there are no names, every second triple."""
    whole = len(run) - len(run) % 3
    found.aside.extend(run[whole:])
    triples = [list(run[start : start + 3]) for start in range(0, whole, 3)]
    named = [sum(bool(_ANGLE.search(title)) for title in triple) >= 2 for triple in triples]
    for index, triple in enumerate(triples):
        unnamed = all(title.startswith("number ") for title in triple)
        second = unnamed and index % 2 == 1 and bool(np.nanmax(np.abs([numbers[t] for t in triple])) <= 360)
        (found.angles if named[index] or second else found.positions).append(triple)
