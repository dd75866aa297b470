"""Replay of a digit from its base outward by the rotations of its receivers, and the tip error (section 6).

There are two bindings of bones to receivers. In the paper's binding (first-frame), bones are the vectors
between joint centres in the first frame, where the tip error is zero. In the other one (least-squares), bones
are constant vectors in their receivers' frames, so that no frame is preferred (`hand.posing`). Either error
is a sum of joint gaps (docs/method.md, "Tip error").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.arrays import Array, Bools, Float, Index
from shukotsu.hand.digit_chain import DigitChain, all_valid, carried_mm, digit_chain, segment_quaternions
from shukotsu.hand.posed_recording import read_skeleton
from shukotsu.hand.posing import PosedRecording, Skeleton, receiver_bones, rigid_positions, root_names
from shukotsu.hand.rotations import conjugate, multiply, rotate
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import METACARPALS
from shukotsu.tables.parts import Opened, Part, PartsReader, PartsWriter
from shukotsu.tables.poses import Poses, PosesReader, poses_reader, usable_poses
from shukotsu.translation import listed

if TYPE_CHECKING:
    from shukotsu.tables.rows import TipErrorsRow

FirstFrame = tuple[Poses, Array | None]
"""First usable frame of a recording, and the metacarpal's quaternion (1, 4) in it, if it is posed."""


def usable_frames(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> Bools:
    """Find the frames in which everything that the digit's replay needs is valid.

    Parameters
    ----------
    chain : DigitChain
        The digit.
    poses : Poses
        T frames.
    metacarpal : array, shape (T, 4), or None
        Posture of the metacarpal, NaN in gaps.

    Returns
    -------
    array of bool, shape (T,)
        Whether the frame can be replayed.

    """
    usable = all_valid(poses, (chain.digit.base, *chain.receivers))
    return usable if metacarpal is None else usable & np.isfinite(metacarpal[:, 0])


def tips_least_squares(bones: PosedRecording) -> dict[str, Array]:
    """Return each digit's tip (T, 3), mm in the transmitter frame, least-squares binding; NaN in gaps."""
    position_mm = rigid_positions(bones)
    return {joint.digit: position_mm[:, index] for index, joint in enumerate(bones.joints) if joint.tip}


def first_frame(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> FirstFrame | None:
    """Find the first usable frame of a digit (section 6).

    Parameters
    ----------
    chain : DigitChain
        The digit.
    poses : Poses
        T frames.
    metacarpal : array, shape (T, 4), or None
        Quaternions of its metacarpal; None if it is posed by a receiver.

    Returns
    -------
    tuple or None
        The frame, and the metacarpal's quaternion (1, 4) in it; None if no frame is usable.

    """
    usable = usable_frames(chain, poses, metacarpal)
    if not usable.any():
        return None
    first = slice(int(np.argmax(usable)), int(np.argmax(usable)) + 1)
    return poses.take(first), None if metacarpal is None else metacarpal[first]


def tip_first_frame(
    chain: DigitChain, poses: Poses, metacarpal: Array | None, first: FirstFrame | None, *, at_rest: bool
) -> Array:
    """Replay a digit's tip with bones bound in the first frame (section 6).

    In the first frame, joints are at their child halves and the tip is at the origin of the distal receiver,
    so that the error is zero. The exception is a metacarpal at rest, which is not bound in the first frame.

    Parameters
    ----------
    chain : DigitChain
        The digit.
    poses : Poses
        T frames.
    metacarpal : array, shape (T, 4), or None
        Posture of the metacarpal, unit quaternions (w, x, y, z), bone to transmitter frame.
    first : FirstFrame or None
        The first usable frame.
    at_rest : bool
        Whether the metacarpal keeps its rest direction (`metacarpals: rest`).

    Returns
    -------
    array, shape (T, 3)
        Tip in the transmitter frame, mm; NaN in gaps.

    """
    usable = usable_frames(chain, poses, metacarpal)
    if first is None:
        return np.full((len(poses.frame), 3), np.nan)
    frame, posture = first
    points = [carried_mm(frame, chain.digit.base, chain.base_point_mm)[0]]
    for segment, child in zip(chain.digit.segments[1:], chain.child_mm[1:], strict=True):
        assert child is not None, "only a metacarpal may lack a joint of its own"
        points.append(carried_mm(frame, segment, child)[0])
    points.append(frame.position_mm[0, frame.index(chain.digit.tip)])
    tip = carried_mm(poses, chain.digit.base, chain.base_point_mm)
    for index, (segment, (start, end)) in enumerate(zip(chain.digit.segments, pairwise(points), strict=True)):
        bone = end - start
        turn, start = metacarpal, posture
        if index or turn is None or start is None:
            turn, start = segment_quaternions(poses, segment), segment_quaternions(frame, segment)
        if turn is metacarpal and at_rest:
            tip = tip + rotate(turn, np.array([np.linalg.norm(bone), 0.0, 0.0]))
        else:
            tip = tip + rotate(multiply(turn, conjugate(start[0])), bone)
    return np.where(usable[:, None], tip, np.nan)


def tip_error_mm(tip: Array, chain: DigitChain, poses: Poses) -> Array:
    """Compute the distance of replayed tips from the origin of the distal receiver (section 6).

    Parameters
    ----------
    tip : array, shape (T, 3)
        Replayed tips in the transmitter frame, mm.
    chain : DigitChain
        The digit.
    poses : Poses
        The same T frames.

    Returns
    -------
    array, shape (T,)
        Distances, mm; NaN in gaps.

    """
    return np.asarray(np.linalg.norm(tip - poses.position_mm[:, poses.index(chain.digit.tip)], axis=-1))


def error_statistics(error_mm: Float[Array, " T"]) -> TipErrorsRow:
    """Compute statistics over all finite errors: those of the paper's tables, the median and a percentile.

    Parameters
    ----------
    error_mm : array, shape (T,)
        Tip errors, NaN in gaps.

    Returns
    -------
    dict
        Columns of tip_errors, mm: maximum, minimum, mean and SD (divisor n), as in the paper; median and 95th
        percentile, which the paper does not have; and the number of frames.

    """
    known_mm = error_mm[np.isfinite(error_mm)]
    if not len(known_mm):
        return {"n_frames": 0}
    return {
        "max_mm": float(known_mm.max()),
        "min_mm": float(known_mm.min()),
        "mean_mm": float(known_mm.mean()),
        "sd_mm": float(known_mm.std()),
        "median_mm": float(np.median(known_mm)),
        "p95_mm": float(np.percentile(known_mm, 95)),
        "n_frames": len(known_mm),
    }


BINDINGS = ("first-frame", "least-squares")


def write_replay(
    plan: SubjectPlan, part: Part, opened: Opened, tips: PartsWriter, errors: PartsWriter
) -> None:
    """Replay one skeleton in its recordings; rows of a recording that was not imported state the reason.

    opened : opens the tables of the skeleton.
    """
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    skeleton = read_skeleton(plan.table, opened, layout, model, part)
    calibrated = plan.calibrating(part.hand, part.model, part.made_without)
    tips.rows(part, [])
    errors.rows(part, [])
    for recording in plan.evaluated(part.hand, part.made_without):
        keys: dict[str, Any] = recording.key
        row_keys = {**keys, "held_out": recording not in calibrated}
        usable, reasons = usable_poses([plan.poses(recording)])
        if reasons:
            for digit in layout.digits:
                errors.rows(part, [{**row_keys, **row} for row in unavailable_rows(digit, reasons[0])])
            continue
        reader = poses_reader(usable, layout.measured)
        with opened(plan.table("metacarpals"), METACARPALS) as parts:
            turns = partial(_turns, parts, part, recording)
            for columns, rows in replay_recording(skeleton, reader, turns):
                if columns is not None:
                    tips.columns(part, {**keys, **columns})
                errors.rows(part, [{**row_keys, **row} for row in rows])


def _turns(
    parts: PartsReader, part: Part, recording: Recording, digit: str, frames: Index
) -> dict[str, Array]:
    """Read quaternions (T, 4) of a digit's metacarpal at those frames, by digit."""
    keys = recording.task, recording.trial, [f"q{name}" for name in "wxyz"]
    return parts.recording(part, *keys, len(frames), frames, digit)


def replay_recording(
    skeleton: Skeleton, recording: PosesReader, metacarpals: Callable[[str, Index], Mapping[str, Array]]
) -> Iterator[tuple[dict[str, Any] | None, list[TipErrorsRow]]]:
    """Replay every digit of a skeleton in one recording.

    Digits are replayed one at a time, as bones of all digits take several times the memory of the recording.

    Parameters
    ----------
    skeleton : Skeleton
        Joint centres and bones of a hand.
    recording : PosesReader
        The recording.
    metacarpals : callable
        (digit, frames (T,)) -> quaternions (T, 4) by digit; empty if the digit has none.

    Yields
    ------
    tuple
        Columns of tips of a block and an empty list, or None and the digit's rows of tip_errors.

    """
    for digit in skeleton.layout.digits.values():
        alone = replace(skeleton, layout=replace(skeleton.layout, digits={digit.name: digit}))
        chain = digit_chain(digit, skeleton.layout, skeleton.model, skeleton.joints)
        receivers = [bone for bone in digit.segments if skeleton.layout.segments[bone].measured]
        replay, reason, n_frames = _Replay(skeleton), chain if isinstance(chain, str) else None, 0
        for poses in recording(*dict.fromkeys([root_names(skeleton.layout)[1], digit.base, *receivers])):
            n_frames += len(poses.frame)
            turns = metacarpals(digit.name, poses.frame)
            bones = receiver_bones(alone, poses, turns)
            reason = reason or bones.left_out.get(digit.name)
            if reason is None and not isinstance(chain, str):
                metacarpal = turns.get(digit.name) if digit.metacarpal else None
                tip_mm = tips_least_squares(bones)[digit.name]
                del bones
                yield replay.columns(chain, poses, metacarpal, tip_mm), []
        if isinstance(chain, str) or reason is not None:
            yield None, unavailable_rows(digit.name, reason or "", n_frames)
        else:
            yield None, replay.rows(chain)


class _Replay:
    """Replay of one digit block by block; accumulates errors of each binding, and segments with a pose."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._first: FirstFrame | None = None
        self._errors_mm: dict[str, list[Array]] = {binding: [] for binding in BINDINGS}
        self._seen: set[str] = set()

    def columns(
        self, chain: DigitChain, poses: Poses, metacarpal: Array | None, tip_mm: Array
    ) -> dict[str, Any]:
        """Build the columns of tips for the next block; tip_mm : (T, 3) of the least-squares binding."""
        measured = self._skeleton.layout.segments[chain.digit.segments[0]].measured
        at_rest = not measured and self._skeleton.model.metacarpals.unmeasured == "rest"
        tip_mm = np.where(usable_frames(chain, poses, metacarpal)[:, None], tip_mm, np.nan)
        self._first = self._first or first_frame(chain, poses, metacarpal)
        bound_mm = tip_first_frame(chain, poses, metacarpal, self._first, at_rest=at_rest)
        errors_mm = [tip_error_mm(tip, chain, poses) for tip in (bound_mm, tip_mm)]
        for blocks, error_mm in zip(self._errors_mm.values(), errors_mm, strict=True):
            blocks.append(error_mm)
        self._seen |= {name for name in poses.segments if poses.valid[:, poses.index(name)].any()}
        return {
            "digit": chain.digit.name,
            "frame": poses.frame,
            "time_s": poses.time_s,
            **{f"tip_{axis}_mm": tip_mm[:, index] for index, axis in enumerate("xyz")},
            "error_mm": errors_mm[1],
            "error_first_frame_mm": errors_mm[0],
        }

    def rows(self, chain: DigitChain) -> list[TipErrorsRow]:
        """Build the rows of tip_errors after the last block."""
        errors_of = {binding: np.concatenate(blocks) for binding, blocks in self._errors_mm.items()}
        least_squares_mm = errors_of[BINDINGS[1]]
        why, needed = "", (chain.digit.base, *chain.receivers)
        if not np.isfinite(least_squares_mm).any():  # receivers not worn, or never all valid at once
            absent = [name for name in needed if name not in self._seen]
            why = f"no frame in which all of {listed(needed)} are valid"
            if absent:
                why = f"the recording has no pose of {listed(absent)}, which the replay needs"
        return [
            _row(chain.digit.name, binding, len(error_mm), why) | error_statistics(error_mm)
            for binding, error_mm in errors_of.items()
        ]


def unavailable_rows(digit: str, reason: str, n_frames: int = 0) -> list[TipErrorsRow]:
    """Build the rows of tip_errors of a digit that could not be replayed.

    Parameters
    ----------
    digit : str
        The digit.
    reason : str
        Why it could not be replayed.
    n_frames : int
        Number of frames of the recording.

    Returns
    -------
    list of dict
        A row for each binding.

    """
    return [_row(digit, binding, n_frames, reason) for binding in BINDINGS]


def _row(digit: str, binding: str, n_frames: int, why: str) -> TipErrorsRow:
    row: TipErrorsRow = {"digit": digit, "binding": binding, "n_frames": 0}
    return row | {"n_frames_total": n_frames, "message": why}
