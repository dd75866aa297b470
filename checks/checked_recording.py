"""The findings on one recording, and what of it is compared with the subject's others."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from checks.expected_body import ExpectedBody, expected_body
from checks.explaining import Explanation
from checks.hypotheses import Recorded, hypotheses
from checks.mistake_search import Mistake, Search, find_mistakes
from checks.sampled_motion import motion_of, receiver_axes
from checks.timeline import (
    Timeline,
    alike,
    away,
    jumping_share,
    repeated_share,
    sides,
    spikes,
    stuck,
    true_clock,
    turning_speed,
    zeros,
)
from schemas.findings import NOTE, REFUSED, SUSPECT, Finding
from schemas.layout import Layout
from schemas.poses import Poses
from skeleton.rotations import Array

SHORT_FRAMES, SHORT_S, NO_FRAMES = 50, 1.0, 10
OPEN_GAP_MM = 15.0
MANY_STUCK, MANY_REPEATED = 0.02, 0.4
SPEED_LIMIT_RAD_S = 60.0
UNEXPLAINED = -25.0
"""Log likelihood a joint; of loose receivers it is about -8."""


@dataclass(frozen=True)
class CheckedRecording:
    """findings : likeliest first. digest : of the poses, number by number. body, explanation : of the joints
    with all mistakes undone; None where there was nothing to explain.
    """

    findings: tuple[Finding, ...]
    digest: str
    body: ExpectedBody | None
    explanation: Explanation | None


def check_recording(
    poses: Poses,
    layout: Layout,
    hand: str,
    orientation: Mapping[str, str] | None = None,
    left_out: Mapping[str, Mapping[str, int]] | None = None,
) -> CheckedRecording:
    """Test what was declared about a recording against its poses.

    orientation : that of the mapping that it was read with, its kind, axes and unit; None where it has none.
    left_out : by flag and segment, of those in LEFT_OUT: how many poses the import left out, or put back.
    """
    declared = orientation or {}
    euler = declared.get("axes", "") if declared.get("kind") == "euler" else ""
    seen = [place for place, own in enumerate(poses.valid.T) if own.any()]
    worn = slice(None) if len(seen) == len(poses.segments) else seen  # a slice copies nothing
    line = Timeline(poses.time_s, poses.position_mm[:, worn], poses.quaternion[:, worn], poses.valid[:, worn])
    segments = tuple(poses.segments[place] for place in seen)
    body = expected_body(layout, segments)
    clock = true_clock(line)
    short = _too_short(line, timed=clock is None)
    if (short and short.severity == REFUSED) or not body.names:
        return CheckedRecording((short,) if short else (), poses_digest(poses), None, None)
    if angles := _angles(line, declared):
        return CheckedRecording(tuple(angles), poses_digest(poses), None, None)
    findings, search = _explained(line, body, layout, segments, hand, euler)
    if "hemisphere-undecided" in (left_out or {}):  # a repair was tried, or would not help
        findings = [finding for finding in findings if finding.kind != "hemisphere"]
    late = [
        *_left_out(left_out or {}),
        *_frozen(poses),
        *_zeros(line, segments),
        *_alike(line, segments),
        *_stays(line, segments),
        *_clock(line, clock),
        *([short] if short else []),
    ]
    return CheckedRecording((*findings, *late), poses_digest(poses), body, search.explanation)


def poses_digest(poses: Poses) -> str:
    """Give a digest of all poses, whatever their names, frames and times; empty where there is none."""
    if not poses.valid.any():
        return ""
    digest = hashlib.sha256()
    for place in np.flatnonzero(poses.valid.any(0)):
        for numbers in (poses.position_mm, poses.quaternion):
            digest.update(numbers[:, place].tobytes())
    return digest.hexdigest()[:16]


def _explained(
    line: Timeline, body: ExpectedBody, layout: Layout, segments: tuple[str, ...], hand: str, euler: str
) -> tuple[list[Finding], Search]:
    """Findings of flips, spikes and all that a hypothesis undoes."""
    jumping = jumping_share(line) > 0.5
    sign = np.ones(line.valid.shape) if jumping else sides(line)
    if (sign < 0).any():
        line = replace(line, position_mm=line.position_mm * sign[..., None], valid=line.valid & (sign != 0))
    odd = spikes(line)
    usable = line.valid & ~odd & ~stuck(line) & ~zeros(line)
    axes = receiver_axes(layout, segments)
    motion = motion_of(line.position_mm, line.quaternion, usable, axes, hand)
    recorded = Recorded(layout, segments, axes, hand, bool(body.known.any()), euler)
    search = find_mistakes(motion, body, [] if jumping else hypotheses(recorded, motion))
    if jumping and np.median(search.explanation.gap_mm[0]) > OPEN_GAP_MM:
        return [_jumping()], search
    flips = _flips(line, sign, segments)
    mistakes = search.mistakes
    if mistakes and _unexplained(body, search.explanation):  # guesses on guesses: the likeliest alone
        mistakes = mistakes[:1]
    named = [_finding(one) for one in mistakes if not (flips and one.hypothesis.kind == "hemisphere")]
    return [*flips, *named, *_spikes(line, odd, segments)], search


def _unexplained(body: ExpectedBody, explanation: Explanation) -> bool:
    """Whether even with all mistakes undone this is no hand."""
    return bool(body.known.all() and explanation.total[0] < UNEXPLAINED * len(body.names))


def _finding(mistake: Mistake) -> Finding:
    one = mistake.hypothesis
    return Finding(one.kind, SUSPECT, f"{_capital(one.what)}: {mistake.evidence}; {one.cure}.")


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _at(line: Timeline, row: int) -> str:
    time_s = line.time_s[row]
    return f"at {time_s:.2f} s" if np.isfinite(time_s) else f"in row {row + 1} of its rows"


def _flips(line: Timeline, sign: Array, segments: Sequence[str]) -> list[Finding]:
    changes = away(sign)
    if not changes.any():
        return []
    most = int(np.argmax(changes))
    first = int(np.argmax(sign[:, most] < 0))
    others = int((changes > 0).sum()) - 1
    also = (
        f", and so do {others} other receivers"
        if others > 1
        else ", and so does another receiver"
        if others
        else ""
    )
    message = (
        f"The position of {segments[most]} jumps to the other side of the transmitter {changes[most]} "
        f"time{'s' if changes[most] > 1 else ''}, first {_at(line, first)}{also}: the tracker took the wrong "
        "hemisphere; write `repair` in the column hemisphere of the recordings sheet (or "
        "--repair-hemisphere)."
    )
    return [Finding("hemisphere", SUSPECT, message)]


def _spikes(line: Timeline, odd: np.ndarray, segments: Sequence[str]) -> list[Finding]:
    if not odd.any():
        return []
    place = int(np.argmax(odd.sum(0)))
    row = int(np.argmax(odd[:, place]))
    count = int(odd.sum())
    message = (
        f"{_capital(f'{count} poses are' if count > 1 else 'one pose is')} where nothing can be, such as "
        f"that of {segments[place]} {_at(line, row)}: probably the tracker's field was disturbed or a row is "
        "damaged; leave the seven numbers of these rows empty."
    )
    return [Finding("spikes", SUSPECT, message)]


def _jumping() -> Finding:
    return Finding(
        "spikes", REFUSED,
        "The poses jump about from frame to frame as no body moves, and no joint closes: these are probably "
        "not the columns of positions and orientations; name the right ones in the mapping.",
    )  # fmt: skip


def _stays(line: Timeline, segments: Sequence[str]) -> list[Finding]:
    repeated = repeated_share(line)
    if repeated > MANY_REPEATED:
        message = (
            f"In {100 * repeated:.0f} % of the frames every receiver stands as in the frame before: probably "
            "the program repeats the last values; write `in_step: false` under `csv` and the tracker's "
            "`rate_hz` in the mapping."
        )
        return [Finding("receiver-stuck", NOTE, message)]
    still = stuck(line)
    share = still.sum(0) / np.maximum(line.valid.sum(0), 1)
    if not still.any():
        return []
    place = int(np.argmax(share))
    row = int(np.argmax(still[:, place]))
    message = (
        f"The receiver {segments[place]} gives one and the same pose in {100 * share[place]:.0f} % of its "
        f"frames, first {_at(line, row)}, while others move: probably its channel hung; leave the seven "
        "numbers of these rows empty, or leave the recording out with `exclude` in the recordings sheet."
    )
    return [Finding("receiver-stuck", SUSPECT if share[place] > MANY_STUCK else NOTE, message)]


def _zeros(line: Timeline, segments: Sequence[str]) -> list[Finding]:
    empty = zeros(line)
    if not empty.any():
        return []
    count, place = int(empty.sum()), int(np.argmax(empty.sum(0)))
    row = int(np.argmax(empty[:, place]))
    poses = f"{count} poses, most of {segments[place]}," if count > 1 else f"One pose, of {segments[place]},"
    message = (
        f"{poses} first {_at(line, row)}, {'are' if count > 1 else 'is'} at 0, 0, 0 and not turned, to the "
        "last bit: probably the program writes zeros where it has no value; leave the seven numbers of "
        "these rows empty."
    )
    return [Finding("zeros", SUSPECT, message)]


def _alike(line: Timeline, segments: Sequence[str]) -> list[Finding]:
    empty = zeros(line)
    pairs = alike(replace(line, valid=line.valid & ~empty) if empty.any() else line)
    if not pairs:
        return []
    (first, second), rows = max(pairs.items(), key=lambda pair: len(pair[1]))
    share = len(rows) / max(1, int(line.valid[:, [first, second]].all(1).sum()))
    message = (
        f"The receivers {segments[first]} and {segments[second]} have one and the same pose in "
        f"{100 * share:.0f} % of their frames, first {_at(line, int(rows[0]))}, which two receivers cannot: "
        "probably one is read, or was exported, in place of the other; name each one's own columns or "
        "station, or export the file again."
    )
    return [Finding("receivers-alike", SUSPECT, message)]


LEFT_OUT = {
    "hemisphere-flip": (
        "hemisphere",
        NOTE,
        "Poses on the other side of the transmitter were left out",
        "the tracker took the wrong hemisphere; write `repair` in the column hemisphere of the recordings "
        "sheet (or --repair-hemisphere) to put them back",
    ),
    "hemisphere-transit": (
        "hemisphere",
        NOTE,
        "Poses between the two sides of the transmitter were left out",
        "the tracker's filter smears a jump over some frames; nothing has to be done",
    ),
    "hemisphere-repaired": (
        "hemisphere",
        NOTE,
        "Poses on the other side of the transmitter were put back",
        "the recordings sheet, or --repair-hemisphere, asks for it; nothing has to be done",
    ),
    "hemisphere-undecided": (
        "hemisphere",
        SUSPECT,
        "Poses are on either side of the transmitter and nothing tells which side is right",
        "they were kept as recorded; leave those on the wrong side empty, or give a reason under `exclude` "
        "in the recordings sheet",
    ),
    "spike": (
        "spikes",
        NOTE,
        "Poses where nothing can be were left out",
        "the tracker's field was probably disturbed; look for metal or a motor near the transmitter",
    ),
}
"""By flag of poses: the kind, how grave it is, what became of them, and why and what to do."""


def _left_out(left_out: Mapping[str, Mapping[str, int]]) -> list[Finding]:
    found = []
    for flag, by_segment in left_out.items():
        kind, severity, what, cure = LEFT_OUT[flag]
        counts = sorted(by_segment.items(), key=lambda one: -one[1])
        which = ", ".join(f"{segment} {count}" for segment, count in counts)
        found.append(Finding(kind, severity, f"{what} ({which}): {cure}."))
    return found


def _frozen(poses: Poses) -> list[Finding]:
    """Receivers that the import leaves out because they never move though their parents do."""
    numbers = np.concatenate([poses.position_mm[:1], poses.position_mm[-1:]])
    there = np.isfinite(numbers).all((0, 2)) & (numbers[0] == numbers[-1]).all(-1)
    names = [name for name, dead in zip(poses.segments, there & ~poses.valid.any(0), strict=True) if dead]
    message = (
        f"The receiver {names[0] if names else ''} gives one and the same pose all along while others move, "
        "and is not used: probably its channel hung; check its plug, and record again."
    )
    return [Finding("receiver-stuck", NOTE, message)] if names else []


def _clock(line: Timeline, clock: tuple[float, str] | None) -> list[Finding]:
    if clock is None:
        return []
    factor, unit = clock
    read = "seconds" if factor < 1 else ("milliseconds" if factor < 1e4 else "microseconds")
    rate = 1 / line.interval_s
    message = (
        f"The times make {rate:.3g} frames a second: they seem to be in {unit} and are read as {read}; "
        f"write `time_unit: {unit}` under `csv` in the mapping, or give time_s in seconds."
    )
    return [Finding("time-unit", SUSPECT, message)]


def _angles(line: Timeline, declared: Mapping[str, str]) -> list[Finding]:
    """Degrees read as radians turn a receiver some 57 times too fast."""
    if declared.get("unit") != "rad" or not turning_speed(line) > SPEED_LIMIT_RAD_S:
        return []
    message = (
        f"The receivers turn at {turning_speed(line):.0f} rad/s: the angles seem to be degrees and are read "
        "as radians; write `unit: deg` under `orientation` in the mapping."
    )
    return [Finding("units", SUSPECT, message)]


def _too_short(line: Timeline, *, timed: bool) -> Finding | None:
    frames = int(line.valid.any(1).sum()) if line.valid.size else 0
    times = line.time_s[np.isfinite(line.time_s)]
    duration = float(times.max() - times.min()) if len(times) and timed else np.inf
    if frames >= SHORT_FRAMES and duration >= SHORT_S:
        return None
    length = f"{frames} frames" + (f" and {duration:.2g} s" if np.isfinite(duration) else "")
    message = (
        f"The recording has {length}, too short for a joint to show how it moves: probably it was stopped at "
        "once or the file is cut off; record it again, or give a reason under `exclude` in the recordings "
        "sheet."
    )
    return Finding("too-short", REFUSED if frames < NO_FRAMES else SUSPECT, message)
