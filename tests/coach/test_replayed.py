"""What was entered stands behind an archive's end, and comes again when it was entered."""

from __future__ import annotations

from pathlib import Path

from captures import cycle, write

from shukotsu.coach.live_poses import marks_in
from shukotsu.coach.replayed import Replayed
from shukotsu.trackers.archive import append_events


def test_marks_come_before_the_piece_that_came_next(tmp_path: Path) -> None:
    path = write(tmp_path / "a.arrows", [cycle(frame) for frame in range(150)])
    at_ns = [0, round(70e9 / 240), 10**12]
    append_events(path, [("mark", host_ns, {"kind": str(nth)}) for nth, host_ns in enumerate(at_ns)])
    replayed, came = Replayed(path, 0), list[object]()
    while not replayed.ended:
        came += [
            [mark["kind"] for mark in marks_in(piece, path)] or len(piece.kind) for piece in replayed.read()
        ]
    assert came == [["0"], 52, ["1"], 50, 50, ["2"], 1]
