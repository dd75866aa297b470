"""Check one recording: its findings, and what is compared with the subject's other recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.checks import timeline
from shukotsu.checks.expected_body import ExpectedBody, expected_body
from shukotsu.checks.hypotheses import TIDY, Declared, Recorded, hypotheses
from shukotsu.checks.mistake_search import (
    WIDER_MM,
    Explanation,
    Search,
    effect,
    explain_joints,
    find_mistakes,
)
from shukotsu.checks.timeline import BLOCK_ROWS, Timeline
from shukotsu.hand.sampled_motion import motion_of, receiver_axes
from shukotsu.study.findings import NOTE, REFUSED, SUSPECT, Finding, Values, severity_of_loss
from shukotsu.study.layout import Layout
from shukotsu.tables.device_clock import ClockBreak, device_clock, without_packets
from shukotsu.tables.limits import SECONDS_PER_UNIT
from shukotsu.tables.poses import Poses

SHORT_FRAMES, SHORT_S, NO_FRAMES = 50, 1.0, 10
"""A recording below either of the first two is suspect; one with fewer than NO_FRAMES frames is refused."""
OPEN_GAP_MM = 15.0
"""Median joint gap above which a recording whose poses jump about is refused."""
MANY_REPEATED = 0.4
"""Share of frames in which all receivers repeat the previous one, above which this is reported."""
MOST_NAMED = 8
"""Largest number of spikes that are listed in a finding."""
SPEED_LIMIT_RAD_S = 25.0
"""Largest turning speed of a hand's receivers between frames; fast playing fingers reach a third of it."""
UNEXPLAINED = -25.0
"""Log likelihood per joint below which a recording is unlike any hand; loose receivers give about -8."""


@dataclass(frozen=True)
class CheckedRecording:
    """Result of checking one recording.

    findings : in the order in which they are reported. digest : of the poses. body, explanation : expected
    body, and joints with all mistakes undone; None if the recording could not be tested.
    """

    findings: tuple[Finding, ...]
    digest: str
    body: ExpectedBody | None
    explanation: Explanation | None


def check_recording(
    poses: Poses,
    layout: Layout,
    hand: str,
    declared: Declared = TIDY,
    left_out: Mapping[str, Mapping[str, int]] | None = None,
    breaks: Sequence[Values] = (),
) -> CheckedRecording:
    """Test what was declared about a recording against its poses.

    Parameters
    ----------
    poses : Poses
        The recording.
    layout : Layout
        Layout of its hand.
    hand : str
        "right" or "left", as declared.
    declared : Declared
        What the mapping or the tidy table declares.
    left_out : mapping, optional
        Poses that the import left out or put back: flag -> segment -> count.
    breaks : sequence, optional
        Breaks and exchanges that the import found.

    Returns
    -------
    CheckedRecording
        Findings, and what is compared between recordings.

    """
    broken = _breaks(breaks)
    seen = [index for index, column in enumerate(poses.valid.T) if column.any()]
    time_s, packets = without_packets(poses.time_s)
    line = Timeline(time_s, poses.position_mm, poses.quaternion, poses.valid)
    if len(seen) < len(poses.segments):
        line = Timeline(time_s, poses.position_mm[:, seen], poses.quaternion[:, seen], poses.valid[:, seen])
    segments = tuple(poses.segments[index] for index in seen)
    body = expected_body(layout, segments)
    clock = timeline.true_clock(line)
    duration_s, clock_breaks = (None, []) if clock else device_clock(line.time_s, poses.frame)
    frames = int(line.valid.any(1).sum())
    short: list[Finding] = []
    if frames < SHORT_FRAMES or not (duration_s is None or duration_s >= SHORT_S):
        length = {"frames": frames} | ({} if duration_s is None else {"duration_s": duration_s})
        short = [Finding("too-short", REFUSED if frames < NO_FRAMES else SUSPECT, "", length)]
    if frames < NO_FRAMES or not body.names:
        return CheckedRecording((*broken, *short), poses_digest(poses), None, None)
    # degrees read as radians make a receiver turn 57 times too fast
    speed_rad_s = timeline.turning_speed(line, most_frames=1) if declared.angle_unit == "rad" else 0.0
    if speed_rad_s > SPEED_LIMIT_RAD_S:
        angles = Finding("units", SUSPECT, "degrees", {"speed_rad_s": speed_rad_s})
        return CheckedRecording((*broken, angles), poses_digest(poses), None, None)
    is_hand = bool(body.has_anatomy.any())
    recorded = Recorded(layout, segments, receiver_axes(layout, segments), hand, is_hand, declared)
    findings, search = _findings_of_hypotheses(line, poses.frame, body, recorded)
    if "hemisphere-undecided" in (left_out or {}):  # the import could not decide, so a repair would not help
        findings = [finding for finding in findings if finding.kind != "hemisphere"]
    ends = np.concatenate([poses.position_mm[:1], poses.position_mm[-1:]])
    dead = np.isfinite(ends).all((0, 2)) & (ends[0] == ends[-1]).all(-1) & ~poses.valid.any(0)
    dead_names = {poses.segments[index] for index in np.flatnonzero(dead)}
    # such a receiver contradicts its neighbours, too, but did not fall off
    broken = _breaks([seen for seen in breaks if not dead_names.issuperset(seen["segments"])])
    frozen = [  # the first receiver that the import rejected because it never moves although its parent does
        Finding("receiver-stuck", SUSPECT, "all-along", {"segment": poses.segments[index]})
        for index in np.flatnonzero(dead)[:1]
    ]
    empty = timeline.zeros(line)
    late = [
        *_left_out(left_out or {}, len(poses.frame)),
        *frozen,
        *([Finding("zeros", SUSPECT, "", _most(line, empty, segments))] if empty.any() else []),
        *_alike(line, empty, segments, declared),
        *_stays(line, segments, declared),
        *_clock(line, clock, declared),
        *_clock_breaks(clock_breaks, poses.frame),
        *([] if clock or not packets else [Finding("clock", NOTE, "packets", vars(packets))]),
        *short,
    ]
    return CheckedRecording((*broken, *findings, *late), poses_digest(poses), body, search.explanation)


def poses_digest(poses: Poses) -> str:
    """Return a digest of all poses, independent of names, frames and times; "" if there are none."""
    if not poses.valid.any():
        return ""
    digest = hashlib.sha256()
    for index in np.flatnonzero(poses.valid.any(0)):
        for numbers in (poses.position_mm, poses.quaternion):
            for start in range(0, len(poses.frame), BLOCK_ROWS):
                digest.update(numbers[start : start + BLOCK_ROWS, index].tobytes())
    return digest.hexdigest()[:16]


def _findings_of_hypotheses(
    line: Timeline, frame: np.ndarray, body: ExpectedBody, recorded: Recorded, *, flipping: bool = True
) -> tuple[list[Finding], Search]:
    """Return the findings of flips, spikes and mistaken declarations, and the search for the latter.

    flipping : whether to look for flips; false in a second pass if undoing them made the joints worse.
    """
    as_recorded, segments = line, recorded.segments
    jumping = sum(timeline.jumps(line, receiver) for receiver in range(len(segments))) > 0.5 * len(segments)
    sign = timeline.sides(line) if flipping and not jumping else np.ones(line.valid.shape, np.int8)
    if (sign < 0).any():
        line = replace(line, position_mm=line.position_mm.copy(), valid=line.valid & (sign != 0))
        for receiver in np.flatnonzero((sign < 0).any(0)):
            line.position_mm[:, receiver] = line.position_mm[:, receiver] * sign[:, receiver, None]
    odd = timeline.spikes(line)
    usable = line.valid & ~odd & ~timeline.stuck(line) & ~timeline.zeros(line)
    motion = motion_of(line.position_mm, line.quaternion, usable, recorded.axes, recorded.hand)
    search = find_mistakes(motion, body, [] if jumping else hypotheses(recorded, motion))
    if jumping and np.median(search.explanation.gap_mm[0]) > OPEN_GAP_MM:
        return [Finding("spikes", REFUSED, "all", recorded.declared.unmapped)], search
    flips = _flips(line, sign, segments)
    if flips:
        as_read = motion_of(as_recorded.position_mm, line.quaternion, usable, recorded.axes, recorded.hand)
        flipped = np.flatnonzero((sign < 0).any(0)).tolist()
        matters = effect(body, explain_joints(as_read, body), explain_joints(motion, body), flipped)
        if matters["gap_after_mm"] > matters["gap_before_mm"] + WIDER_MM:  # so no receiver had flipped
            return _findings_of_hypotheses(as_recorded, frame, body, recorded, flipping=False)
        flips = [replace(flips[0], values={**flips[0].values, **matters})]
    mistakes = search.mistakes
    if body.has_anatomy.all() and search.explanation.total[0] < UNEXPLAINED * len(body.names):
        mistakes = mistakes[:1]  # even with all undone it is unlike a hand, so the later ones are guesses
    found = [(mistake.hypothesis, mistake.evidence) for mistake in mistakes]
    named = [
        Finding(undone.kind, SUSPECT, undone.variant, {**undone.values, **evidence})
        for undone, evidence in found
        if not (flips and undone.kind == "hemisphere")
    ]
    if all(finding.kind != "euler-order" for finding in named):  # whose angles jump near their singularities
        named += _spikes(line, frame, odd, segments)
    return [*flips, *named], search


def _first(line: Timeline, row: int) -> Values:
    """Return the time of a row as the value of a finding; for rows without a time, the row's number."""
    time_s = float(line.time_s[row])
    return {"first_s": round(time_s, 2)} if np.isfinite(time_s) else {"first_row": row + 1}


def _most(line: Timeline, poses: npt.NDArray[np.bool_], segments: Sequence[str]) -> Values:
    """Return the segment with most of the marked poses (T, S), their total number, and when its first is."""
    receiver = int(np.argmax(poses.sum(0)))
    first = _first(line, int(np.argmax(poses[:, receiver])))
    return {"segment": segments[receiver], "count": int(poses.sum()), **first}


def _flips(line: Timeline, sign: npt.NDArray[np.int8], segments: Sequence[str]) -> list[Finding]:
    changes = timeline.away(sign)
    if not changes.any():
        return []
    most, others = int(np.argmax(changes)), int((changes > 0).sum()) - 1
    seen = {"segment": segments[most], "count": int(changes[most]), "others": others}
    first = _first(line, int(np.argmax(sign[:, most] < 0)))
    return [Finding("hemisphere", SUSPECT, "jumps", {**seen, **first})]


def _spikes(line: Timeline, frame: np.ndarray, odd: np.ndarray, segments: Sequence[str]) -> list[Finding]:
    """Return a finding that lists spikes; frame : (T,) numbers as in the file; odd : (T, S) spikes."""
    if not odd.any():
        return []
    seen = _most(line, odd, segments)
    spiked = [
        [segments[receiver], int(frame[row]), *filter(np.isfinite, [float(line.time_s[row])])]
        for row, receiver in np.argwhere(odd)[:MOST_NAMED]
    ]
    return [Finding("spikes", SUSPECT, "some", {**seen, "spiked": spiked})]


def _stays(line: Timeline, segments: Sequence[str], declared: Declared) -> list[Finding]:
    repeated = timeline.repeated_share(line)
    if repeated > MANY_REPEATED:
        seen = {"percent": 100 * float(repeated), **declared.unmapped}
        return [Finding("receiver-stuck", NOTE, "repeated", seen)]
    still = timeline.stuck(line)
    share = still.sum(0) / np.maximum(line.valid.sum(0), 1)
    if not still.any():
        return []
    receiver = int(np.argmax(share))
    row = int(np.argmax(still[:, receiver]))
    percent = 100 * float(share[receiver])
    seen = {"segment": segments[receiver], "percent": percent, **_first(line, row)}
    return [Finding("receiver-stuck", severity_of_loss(percent), "at-times", seen)]


def _alike(
    line: Timeline, empty: npt.NDArray[np.bool_], segments: Sequence[str], declared: Declared
) -> list[Finding]:
    pairs = timeline.alike(replace(line, valid=line.valid & ~empty) if empty.any() else line)
    if not pairs:
        return []
    (first, second), rows = max(pairs.items(), key=lambda pair: len(pair[1]))
    share = len(rows) / max(1, int(line.valid[:, [first, second]].all(1).sum()))
    pair = {"segment": segments[first], "segment_2": segments[second]}
    seen = {**pair, "percent": 100 * share, **_first(line, int(rows[0])), **declared.unmapped}
    return [Finding("receivers-alike", SUSPECT, "", seen)]


LEFT_OUT = {
    "hemisphere-flip": ("hemisphere", "", "left-out"),
    "hemisphere-transit": ("hemisphere", "", "between"),
    "hemisphere-repaired": ("hemisphere", NOTE, "put-back"),
    "hemisphere-undecided": ("hemisphere", SUSPECT, "undecided"),
    "spike": ("spikes", "", "left-out"),
}
"""Flag of poses that the import left out or put back -> kind, severity and variant of the finding; the
severity is "" if it depends on the number of poses."""


def _left_out(left_out: Mapping[str, Mapping[str, int]], frames: int) -> list[Finding]:
    findings = []
    for flag, by_segment in left_out.items():
        kind, severity, variant = LEFT_OUT[flag]
        named = sorted(by_segment, key=lambda name: -by_segment[name])
        counts = [by_segment[name] for name in named]
        seen = {"count": sum(counts), "of": named, "counts": counts}
        severity = severity or severity_of_loss(100 * max(counts) / frames)
        findings.append(Finding(kind, severity, variant, seen))
    return findings


def _breaks(breaks: Sequence[Values]) -> list[Finding]:
    """Return the findings of breaks and exchanges, whose poses the import left out."""
    findings = []
    for seen in breaks:
        if "number" in seen:
            pair = dict(zip(("segment", "segment_2"), seen["segments"], strict=True))
            findings.append(Finding("receivers-swapped", SUSPECT, "in-part", {**seen, **pair}))
            continue
        variant = "all" if len(seen["segments"]) > 1 else "until" if seen["until"] else "one"
        severity, segment = severity_of_loss(100 - seen["percent"]), seen["segments"][0]
        findings.append(Finding("sudden-change", severity, variant, {**seen, "segment": segment}))
    return findings


_UNIT_WORDS = {"ns": "nanoseconds", "us": "microseconds", "ms": "milliseconds", "s": "seconds"}
_UNIT_WORDS |= {"hh:mm:ss": "times of day", "iso8601": "dates"}
"""Words for `time_unit`."""


def _clock(line: Timeline, factor: float | None, declared: Declared) -> list[Finding]:
    if factor is None:
        return []
    declared_unit = declared.time_unit or "s"
    read, seconds = _UNIT_WORDS[declared_unit], factor * SECONDS_PER_UNIT.get(declared_unit, np.nan)
    unit = next((name for name, s in SECONDS_PER_UNIT.items() if np.isclose(s, seconds, atol=0)), "")
    rate_hz = 1 / line.interval_s
    seen = {"rate_hz": rate_hz, "unit": unit, "read": read, "factor": factor, **declared.unmapped}
    if declared.rate_hz and not declared.time_unit:
        return [Finding("time-unit", SUSPECT, "rate", {**seen, "true_hz": declared.rate_hz / factor})]
    readable = unit and (declared.time_unit or not declared.format)
    return [Finding("time-unit", SUSPECT, "" if readable else "scaled", seen)]


def _clock_breaks(breaks: Sequence[ClockBreak], frame: np.ndarray) -> list[Finding]:
    """Return a finding for each kind of clock break, with the first one and their number."""
    findings = []
    for kind in dict.fromkeys(step.kind for step in breaks):
        every = [step for step in breaks if step.kind == kind]
        first = {name: getattr(every[0], name) for name in ("from_s", "to_s", "by_s", "rows")}
        seen = {**first, "by": f"{every[0].by_s:.10g}", "number": int(frame[every[0].row])}
        findings.append(Finding("clock", NOTE, kind, {**seen, "steps": len(every)}))
    return findings
