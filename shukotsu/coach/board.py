"""What the coach's faces show and what is entered on them: one board, read and written from any thread.

The coach publishes states and poses and never waits for who reads them: a viewer holds the newest state, and
so many batches of poses, the oldest of which give way.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Mapping
from threading import Condition
from typing import Any

import numpy as np

from shukotsu.errors import InputError

MOST_BATCHES = 12
"""Of poses that wait for one viewer: some three seconds."""
MOST_ENTRIES = 200
"""That wait for the coach."""
MOST_LETTERS = 200
"""Of a text that is entered."""

FIELDS = (
    ("touch", {"digit", "meets"}),
    ("touch", {"digit", "part", "point"}),
    ("length", {"quantity", "value_mm", "sd_mm"}),
    ("note", {"text"}),
    *((kind, {"number"}) for kind in ("done", "skip")),
    *((kind, set[str]()) for kind in ("undo", "done", "skip", "finish")),
)
"""Kinds of entries, each with its other fields: number is a request's, _mm are lengths, others text."""


class Viewer:
    """What one reader of a board has not yet seen, until it is closed."""

    def __init__(self, board: Board, state: str | None) -> None:
        self._board = board
        self._state = state
        self._batches: deque[str] = deque(maxlen=MOST_BATCHES)

    def take(self, timeout_s: float) -> list[tuple[str, str]]:
        """Wait until there is something new; give all of it, oldest first; empty after timeout_s.

        Each is ("state" or "poses", its JSON).
        """
        with self._board.changed:
            self._board.changed.wait_for(lambda: self._state is not None or self._batches, timeout_s)
            found = [] if self._state is None else [("state", self._state)]
            found += [("poses", batch) for batch in self._batches]
            self._state = None
            self._batches.clear()
        return found

    def show(self, kind: str, text: str) -> None:
        """Keep JSON for the reader; the board calls it, and holds its lock."""
        if kind == "state":
            self._state = text
        else:
            self._batches.append(text)

    def close(self) -> None:
        """Have the board keep nothing more for this reader."""
        with self._board.changed:
            self._board.viewers.discard(self)


class Board:
    """The newest state of a calibration, its live poses, and what its faces enter."""

    def __init__(self) -> None:
        self.changed = Condition()
        self._text: str | None = None
        self.viewers: set[Viewer] = set()
        self._entries: deque[dict[str, Any]] = deque()

    def publish(self, state: Mapping[str, Any]) -> None:
        """Make a state the newest one; numbers that are not finite become null."""
        self._show("state", json.dumps(_plain(state), ensure_ascii=False, allow_nan=False))

    def show_poses(self, times_s: Any, poses: Any) -> None:
        """Show a batch of live poses.

        times_s : (n,) s of the recording. poses : (n, receivers, 7) position in mm and quaternion (w, x, y,
        z) in the order of the state's `receivers`; NaN where one has no pose.
        """
        numbers = np.asarray(poses, float)
        rounded = np.concatenate([numbers[..., :3].round(2), numbers[..., 3:].round(5)], -1).astype(object)
        rounded[~np.isfinite(numbers).all(-1)] = None
        shown = [[None if pose[0] is None else pose for pose in frame] for frame in rounded.tolist()]
        times = np.round(times_s, 4).tolist()
        self._show("poses", json.dumps({"times_s": times, "poses": shown}, separators=(",", ":")))

    def _show(self, kind: str, text: str) -> None:
        with self.changed:
            self._text = text if kind == "state" else self._text
            for viewer in self.viewers:
                viewer.show(kind, text)
            self.changed.notify_all()

    def subscribe(self) -> Viewer:
        """Give a new reader the newest state and what is shown from now on; close it with the reader."""
        with self.changed:
            viewer = Viewer(self, self._text)
            self.viewers.add(viewer)
        return viewer

    def enter(self, entry: Mapping[str, Any]) -> None:
        """Take what an operator enters.

        Raises InputError where it has not the fields of its kind (FIELDS), or MOST_ENTRIES wait already;
        whether there is such a digit or quantity, the coach says.
        """
        checked = checked_entry(entry)
        with self.changed:
            if len(self._entries) >= MOST_ENTRIES:
                raise InputError(f"{MOST_ENTRIES} entries wait already; wait until the coach has taken them")
            self._entries.append(checked)

    def entered(self) -> list[dict[str, Any]]:
        """Give what was entered since the last call, in its order."""
        with self.changed:
            found = list(self._entries)
            self._entries.clear()
        return found


def checked_entry(entry: Any) -> dict[str, Any]:
    """Give a copy of an entry that has the fields of its kind and no other; raises InputError."""
    if not isinstance(entry, Mapping):
        raise InputError("the entry is no object; expected one with the field kind")
    if not any(entry.get("kind") == kind and set(entry) == {"kind", *fields} for kind, fields in FIELDS):
        expected = "; ".join(", ".join([kind, *sorted(fields)]) for kind, fields in FIELDS)
        raise InputError(f"the entry has not the fields of its kind; expected one of: {expected}")
    for name, value in entry.items():
        if name.endswith("_mm"):
            low = 0.0 if name == "sd_mm" else -1e4
            if isinstance(value, bool) or not isinstance(value, int | float) or not low < value < 1e4:
                raise InputError(f"{name} of the entry: expected mm above {low:g} and below 10000")
        elif name == "number":
            if isinstance(value, bool) or not isinstance(value, int) or not 0 < value < 1e6:
                raise InputError("number of the entry: expected the number of a request")
        elif not isinstance(value, str) or not value.isprintable() or not 0 < len(value) <= MOST_LETTERS:
            raise InputError(f"{name} of the entry: expected up to {MOST_LETTERS} letters on one line")
    return dict(entry)


def _plain(value: Any) -> Any:
    """Give what JSON can hold of lists, mappings, arrays and numbers: None for what is not finite."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(name): _plain(own) for name, own in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(own) for own in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
