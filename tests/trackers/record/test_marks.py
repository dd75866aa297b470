"""What another program says of a recording while it is made, over the recorder's standard input."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tracker_processes import PATIENCE_S, capture, started

from shukotsu.trackers.archive import END, EVENT, FollowedArchive, append_event, open_archive
from shukotsu.trackers.decode.stream import Tally, blocks_of
from shukotsu.trackers.record.marks import MOST_BYTES, MOST_WAITING, Marks
from shukotsu.trackers.record.port import open_port
from shukotsu.trackers.record.recording_terminal import StopRequest, Terminal
from shukotsu.trackers.record.request import RecordingRequest
from shukotsu.trackers.record.session import RecordingPlan, record

TOUCH = {"kind": "touch", "digit": "index", "meets": "thumb", "name": "é", "host_ns": 1}


def until(true: Callable[[], bool]) -> None:
    """Wait for something; a test whose wait is in vain fails."""
    end = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_marks_are_kept_and_what_is_none_costs_nothing(emulated, tmp_path: Path) -> None:
    """Nor does the end of the input, though the line before it is cut."""
    refused = [b"hello", b"[1]", b"{}", b'{"kind": 5}', b'{"kind": "a", "x": NaN}', b'{"kind": "\\ud800"}']
    refused += [b"[" * 4000, b'{"kind": "' + b"x" * MOST_BYTES + b'"}', b"\xff"]
    plan = RecordingPlan(tmp_path / "a.arrows", RecordingRequest("liberty"), duration_s=1.2, quiet=True)
    listening, speaking = os.pipe()
    os.write(speaking, b"\n".join([json.dumps(TOUCH).encode(), *refused, b'{"kind": "stop"']))
    os.close(speaking)
    port, stop = open_port(emulated("--stations", "1-4"), 115200), StopRequest()
    with (tmp_path / "said").open("w") as said:
        ending = record(plan, port, Terminal(said, None), stop, {}, marks=Marks(listening, stop))
    port.close()
    os.close(listening)
    tally = Tally()
    records = sum(len(block.records) for block in blocks_of(open_archive(plan.out), tally))
    assert (ending.reason, ending.totals and ending.totals["records"]) == ("--duration 1.2", records)
    (mark,) = [event for event in tally.events if event["event"] == "mark"]
    assert mark["host_ns"] > TOUCH["host_ns"]
    assert mark | {"host_ns": 1} == {"event": "mark", **TOUCH}
    none = [event["reason"] for event in tally.events if event["event"] == "mark-refused"]
    kinds = [
        "is no JSON",
        *["is no object with a kind"] * 3,
        *["is no JSON"] * 3,
        f"is longer than {MOST_BYTES} bytes",
    ]
    assert none == [*kinds, "is no JSON", "is no JSON"]
    assert ending.notices == (
        "a line on standard input is no JSON; it is no mark",
        "standard input has ended; the recording goes on until a signal ends it",
        "10 lines on standard input were no marks",
    )
    assert "Hz" not in (tmp_path / "said").read_text()


def test_a_program_follows_the_recording_that_it_marks_and_ends(emulated, tmp_path: Path) -> None:
    out, port = tmp_path / "a.arrows", emulated("--stations", "1-2")
    followed, found = FollowedArchive(out), list[dict[str, Any]]()

    def heard(name: str) -> bool:
        for piece in followed.read():
            kinds = zip(piece.kind, piece.data, strict=True)
            found.extend(json.loads(data) for kind, data in kinds if kind in (EVENT, END))
        return any(event.get("event") == name for event in found)

    options = ("--port", port, "--out", str(out), "--marks", "--quiet")
    with started("record", *options, stdin=subprocess.PIPE) as recorder:
        assert recorder.stdin is not None
        until(lambda: heard("started"))
        print(json.dumps(TOUCH), file=recorder.stdin, flush=True)
        until(lambda: heard("mark"))
        printed, said = recorder.communicate('{"kind": "stop"}\n', timeout=PATIENCE_S)
    assert recorder.returncode == 0
    assert "(stop on standard input)" in printed
    assert said.splitlines()[0].startswith("setting up the tracker")
    assert "receivers" not in said
    until(lambda: heard("stopped") and followed.ended)
    assert found[-1]["reason"] == "stop on standard input"
    append_event(out, "verdict", 1, joint="index_pip")
    tally = Tally()
    assert sum(len(block.records) for block in blocks_of(open_archive(out), tally)) == found[-1]["records"]
    assert tally.events[-1] == {"event": "verdict", "joint": "index_pip", "host_ns": 1}
    assert "unreadable" not in capture("inspect", str(out)).stdout


def test_a_stop_is_heard_while_nobody_takes_marks() -> None:
    listening, speaking = os.pipe()
    stop = StopRequest()
    marks = Marks(listening, stop)
    os.write(speaking, b'{"kind": "note"}\n' * MOST_WAITING + b'{"kind": "stop"}\n')
    until(lambda: bool(stop))
    os.close(speaking)
    taken = marks.taken()
    while taken[-1].name != "marks-ended":
        taken += marks.taken()
    assert len(taken) == MOST_WAITING + 1
    os.close(listening)
