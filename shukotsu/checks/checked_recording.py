"""The findings on one recording, and what of it is compared with the subject's others."""

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
OPEN_GAP_MM = 15.0
MANY_REPEATED = 0.4
MOST_NAMED = 8
"""Poses that are named, of those where nothing can be."""
SPEED_LIMIT_RAD_S = 25.0
"""Turning of a hand's receivers from one frame to the next: fingers that play fast reach a third of it."""
UNEXPLAINED = -25.0
"""Log likelihood a joint; of loose receivers it is about -8."""


@dataclass(frozen=True)
class CheckedRecording:
    """Findings, likeliest first; a digest of the poses; joints with all mistakes undone, if any."""

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
    """Test what was declared about a recording against its poses; left_out, breaks : of its import."""
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
    frames = int(line.valid.any(1).sum()) if line.valid.size else 0
    short: list[Finding] = []
    if frames < SHORT_FRAMES or not (duration_s is None or duration_s >= SHORT_S):
        length = {"frames": frames} | ({} if duration_s is None else {"duration_s": duration_s})
        short = [Finding("too-short", REFUSED if frames < NO_FRAMES else SUSPECT, "", length)]
    if frames < NO_FRAMES or not body.names:
        return CheckedRecording((*broken, *short), poses_digest(poses), None, None)
    # degrees read as radians turn a receiver some 57 times too fast
    speed_rad_s = timeline.turning_speed(line, most_frames=1) if declared.angle_unit == "rad" else 0.0
    if speed_rad_s > SPEED_LIMIT_RAD_S:
        angles = Finding("units", SUSPECT, "degrees", {"speed_rad_s": speed_rad_s})
        return CheckedRecording((*broken, angles), poses_digest(poses), None, None)
    findings, search = _findings_of_hypotheses(line, poses.frame, body, layout, segments, hand, declared)
    if "hemisphere-undecided" in (left_out or {}):  # a repair was tried, or would not help
        findings = [finding for finding in findings if finding.kind != "hemisphere"]
    ends = np.concatenate([poses.position_mm[:1], poses.position_mm[-1:]])
    dead = np.isfinite(ends).all((0, 2)) & (ends[0] == ends[-1]).all(-1) & ~poses.valid.any(0)
    frozen = [  # the first receiver that the import leaves out as it never moves though its parent does
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
    """A digest of all poses, whatever their names, frames and times; empty where there is none."""
    if not poses.valid.any():
        return ""
    digest = hashlib.sha256()
    for index in np.flatnonzero(poses.valid.any(0)):
        for numbers in (poses.position_mm, poses.quaternion):
            for start in range(0, len(poses.frame), BLOCK_ROWS):
                digest.update(numbers[start : start + BLOCK_ROWS, index].tobytes())
    return digest.hexdigest()[:16]


def _findings_of_hypotheses(
    line: Timeline,
    frame: np.ndarray,
    body: ExpectedBody,
    layout: Layout,
    segments: tuple[str, ...],
    hand: str,
    declared: Declared,
    *,
    flipping: bool = True,
) -> tuple[list[Finding], Search]:
    """Findings of flips, spikes and all that a hypothesis undoes; flipping : whether there may be flips."""
    as_recorded = line
    jumping = sum(timeline.jumps(line, receiver) for receiver in range(len(segments))) > 0.5 * len(segments)
    sign = timeline.sides(line) if flipping and not jumping else np.ones(line.valid.shape, np.int8)
    if (sign < 0).any():
        line = replace(line, position_mm=line.position_mm.copy(), valid=line.valid & (sign != 0))
        for receiver in np.flatnonzero((sign < 0).any(0)):
            line.position_mm[:, receiver] = line.position_mm[:, receiver] * sign[:, receiver, None]
    odd = timeline.spikes(line)
    usable = line.valid & ~odd & ~timeline.stuck(line) & ~timeline.zeros(line)
    axes = receiver_axes(layout, segments)
    motion = motion_of(line.position_mm, line.quaternion, usable, axes, hand)
    recorded = Recorded(layout, segments, axes, hand, bool(body.has_anatomy.any()), declared)
    search = find_mistakes(motion, body, [] if jumping else hypotheses(recorded, motion))
    if jumping and np.median(search.explanation.gap_mm[0]) > OPEN_GAP_MM:
        return [Finding("spikes", REFUSED, "all", declared.unmapped)], search
    flips = _flips(line, sign, segments)
    if flips:
        as_read = motion_of(as_recorded.position_mm, line.quaternion, usable, axes, hand)
        flipped = np.flatnonzero((sign < 0).any(0)).tolist()
        matters = effect(body, explain_joints(as_read, body), explain_joints(motion, body), flipped)
        if matters["gap_after_mm"] > matters["gap_before_mm"] + WIDER_MM:  # no receiver that flipped
            rest = (frame, body, layout, segments, hand, declared)
            return _findings_of_hypotheses(as_recorded, *rest, flipping=False)
        flips = [replace(flips[0], values={**flips[0].values, **matters})]
    mistakes = search.mistakes
    if body.has_anatomy.all() and search.explanation.total[0] < UNEXPLAINED * len(body.names):
        mistakes = mistakes[:1]  # no hand even with all undone, guesses on guesses: the likeliest alone
    named = [
        Finding(mistake.hypothesis.kind, SUSPECT, mistake.hypothesis.variant, values)
        for mistake in mistakes
        if not (flips and mistake.hypothesis.kind == "hemisphere")
        for values in [{**mistake.hypothesis.values, **mistake.evidence}]
    ]
    # angles taken about the wrong axes jump near their poles
    jumps = (
        [] if "euler-order" in {finding.kind for finding in named} else _spikes(line, frame, odd, segments)
    )
    return [*flips, *named, *jumps], search


def _first(line: Timeline, row: int) -> Values:
    """When something is first seen; of rows without a time, in which."""
    time_s = float(line.time_s[row])
    return {"first_s": round(time_s, 2)} if np.isfinite(time_s) else {"first_row": row + 1}


def _most(line: Timeline, poses: npt.NDArray[np.bool_], segments: Sequence[str]) -> Values:
    """The segment with most of some poses (T, S), how many there are, and when it has the first."""
    receiver = int(np.argmax(poses.sum(0)))
    first = _first(line, int(np.argmax(poses[:, receiver])))
    return {"segment": segments[receiver], "count": int(poses.sum()), **first}


def _flips(line: Timeline, sign: npt.NDArray[np.int8], segments: Sequence[str]) -> list[Finding]:
    changes = timeline.away(sign)
    if not changes.any():
        return []
    most = int(np.argmax(changes))
    first = int(np.argmax(sign[:, most] < 0))
    seen = {
        "segment": segments[most],
        "count": int(changes[most]),
        "others": int((changes > 0).sum()) - 1,
        **_first(line, first),
    }
    return [Finding("hemisphere", SUSPECT, "jumps", seen)]


def _spikes(line: Timeline, frame: np.ndarray, odd: np.ndarray, segments: Sequence[str]) -> list[Finding]:
    """Name the poses; frame : (T,) as the file or the mapping counts them."""
    if not odd.any():
        return []
    seen = _most(line, odd, segments)
    spiked = [
        [
            segments[receiver],
            int(frame[row]),
            *([float(time_s)] if np.isfinite(time_s := line.time_s[row]) else []),
        ]
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
"""Flags of what the import left out or put back: the kind, how grave it is, empty where that depends on how
many there are, and which of its sentences."""


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
    """Name breaks, whose poses are left out."""
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


def _clock(line: Timeline, factor: float | None, declared: Declared) -> list[Finding]:
    if factor is None:
        return []
    declared_unit = declared.time_unit or "s"
    seconds, read = factor * SECONDS_PER_UNIT[declared_unit], _UNIT_WORDS[declared_unit]
    unit = next((name for name, s in SECONDS_PER_UNIT.items() if np.isclose(s, seconds, atol=0)), "")
    rate_hz = 1 / line.interval_s
    seen = {"rate_hz": rate_hz, "unit": unit, "read": read, "factor": factor, **declared.unmapped}
    if declared.rate_hz and not declared.time_unit:
        return [Finding("time-unit", SUSPECT, "rate", {**seen, "true_hz": declared.rate_hz / factor})]
    readable = unit and (declared.time_unit or not declared.format)
    return [Finding("time-unit", SUSPECT, "" if readable else "scaled", seen)]


def _clock_breaks(breaks: Sequence[ClockBreak], frame: np.ndarray) -> list[Finding]:
    """Name where the clock does not run on, a finding a kind: its first place, and how many there are."""
    findings = []
    for kind in dict.fromkeys(step.kind for step in breaks):
        every = [step for step in breaks if step.kind == kind]
        first = {name: getattr(every[0], name) for name in ("from_s", "to_s", "by_s", "rows")}
        seen = {**first, "by": f"{every[0].by_s:.10g}", "number": int(frame[every[0].row])}
        findings.append(Finding("clock", NOTE, kind, {**seen, "steps": len(every)}))
    return findings
