"""Replay a digit from its base outward, each bone turned by what drives it, and measure its tip.

Two bindings (how the bones are fixed to what turns them):
first-frame, the paper's: bones are the vectors between the joints in the first frame, so that the tip is
exact in that frame; least-squares: bones are constant in their receivers and no frame is special
(`hand.posing`). The error of either is a sum of joint gaps (docs/method.md, "what the tip error says").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError, TableError
from shukotsu.hand.digit_chain import DigitChain, all_valid, carried_mm, digit_chain, segment_quaternions
from shukotsu.hand.posed_recording import read_skeleton
from shukotsu.hand.posing import PosedRecording, Skeleton, receiver_bones, rigid_positions, root_names
from shukotsu.hand.rotations import Array, conjugate, multiply, rotate
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.catalogue import METACARPALS
from shukotsu.tables.parts import Part, PartsWriter, open_parts
from shukotsu.tables.poses import Poses, PosesReader, frame_count, poses_reader
from shukotsu.translation import listed

FirstFrame = tuple[Poses, Array | None]
"""A recording's first usable frame, and the metacarpal's posture (1, 4) in it."""


def usable_frames(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> npt.NDArray[np.bool_]:
    """Frames, (T,), in which all that the digit's replay needs is there; metacarpal : (T, 4), NaN in gaps."""
    usable = all_valid(poses, (chain.digit.base, *chain.receivers))
    return usable if metacarpal is None else usable & np.isfinite(metacarpal[:, 0])


def tips_least_squares(bones: PosedRecording) -> dict[str, Array]:
    """Tip positions (T, 3) mm of every digit in the transmitter frame, bones constant; NaN in gaps."""
    position_mm = rigid_positions(bones)
    return {joint.digit: position_mm[:, index] for index, joint in enumerate(bones.joints) if joint.tip}


def first_frame(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> FirstFrame | None:
    """The first usable frame and the metacarpal's posture (1, 4) in it; None where no frame is usable."""
    usable = usable_frames(chain, poses, metacarpal)
    if not usable.any():
        return None
    first = slice(int(np.argmax(usable)), int(np.argmax(usable)) + 1)
    return poses.take(first), None if metacarpal is None else metacarpal[first]


def tip_first_frame(
    chain: DigitChain, poses: Poses, metacarpal: Array | None, first: FirstFrame | None, *, at_rest: bool
) -> Array:
    """Tip positions (T, 3) mm in the transmitter frame, bones bound in the first frame; NaN in gaps.

    There joints are where the child halves put them and the tip is the distal receiver, so that the error is
    zero; except with a metacarpal `at_rest`, which was never bound to anything.
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
    """Distances (T,) of replayed tips (T, 3) to the distal receiver; NaN in gaps."""
    return np.asarray(np.linalg.norm(tip - poses.position_mm[:, poses.index(chain.digit.tip)], axis=-1))


def error_statistics(error_mm: Array) -> dict[str, Any]:
    """Max, min, mean, SD (divided by n), median and 95th percentile of the errors (T,) that are known."""
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


Index = npt.NDArray[np.int64]

BINDINGS = ("first-frame", "least-squares")


def write_part(plan: SubjectPlan, part: Part, tips: PartsWriter, errors: PartsWriter) -> None:
    """Replay one skeleton in its recordings; one whose import failed has rows of tip_errors that say why."""
    layout, model = plan.layouts[part.hand], plan.models[part.model]
    skeleton = read_skeleton(plan.table("joint_centres"), plan.table("bone_lengths"), layout, model, part)
    calibrated = plan.calibrating(part.hand, part.model, part.made_without)
    tips.rows(part, [])
    errors.rows(part, [])
    for recording in plan.evaluated(part.hand, part.made_without):
        keys: dict[str, Any] = recording.key
        row_keys = {**keys, "held_out": recording not in calibrated}
        try:
            frame_count(plan.poses(recording))
        except TableError:
            raise
        except InputError as error:
            for digit in layout.digits:
                errors.rows(part, [{**row_keys, **row} for row in unavailable_rows(digit, str(error))])
            continue

        def turns(
            digit: str, frames: Index, task: str = recording.task, trial: str = recording.trial
        ) -> dict[str, Array]:
            keys = (task, trial, "digit", [f"q{name}" for name in "wxyz"])
            with open_parts(plan.table("metacarpals"), METACARPALS) as parts:
                return parts.recording(part, *keys, len(frames), frames, digit)

        reader = poses_reader([plan.poses(recording)], layout.measured)
        for columns, rows in replay_recording(skeleton, reader, turns):
            if columns is not None:
                tips.columns(part, {**keys, **columns})
            errors.rows(part, [{**row_keys, **row} for row in rows])


def replay_recording(
    skeleton: Skeleton, recording: PosesReader, metacarpals: Callable[[str, Index], Mapping[str, Array]]
) -> Iterator[tuple[dict[str, Any] | None, list[dict[str, Any]]]]:
    """Columns of tips of every digit in a recording, block by block, then its rows of tip_errors.

    metacarpals : quaternions (T, 4) by digit at some frames (T,), or nothing. A digit at a time, for the
    bones of all take several times the memory of the recording.
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
    """One digit's replay as far as it is; errors by binding, segments those seen."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._first: FirstFrame | None = None
        self._errors_mm: dict[str, list[Array]] = {binding: [] for binding in BINDINGS}
        self._seen: set[str] = set()

    def columns(
        self, chain: DigitChain, poses: Poses, metacarpal: Array | None, tip_mm: Array
    ) -> dict[str, Any]:
        """Columns of tips at the next frames; tip_mm : (T, 3) of the least-squares binding."""
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

    def rows(self, chain: DigitChain) -> list[dict[str, Any]]:
        """Rows of tip_errors, all frames replayed."""
        errors_of = {binding: np.concatenate(blocks) for binding, blocks in self._errors_mm.items()}
        least_squares_mm = errors_of[BINDINGS[1]]
        why, needed = "", (chain.digit.base, *chain.receivers)
        if not np.isfinite(least_squares_mm).any():  # receivers that were not worn, or never all at once
            absent = [name for name in needed if name not in self._seen]
            why = f"no frame in which all of {listed(needed)} are valid"
            if absent:
                why = f"the recording has no pose of {listed(absent)}, which the replay rides on"
        return [
            _row(chain.digit.name, binding, len(error_mm), why) | error_statistics(error_mm)
            for binding, error_mm in errors_of.items()
        ]


def unavailable_rows(digit: str, reason: str, n_frames: int = 0) -> list[dict[str, Any]]:
    """Rows of tip_errors of a digit without numbers, and why."""
    return [_row(digit, binding, n_frames, reason) for binding in BINDINGS]


def _row(digit: str, binding: str, n_frames: int, why: str) -> dict[str, Any]:
    keys = {"digit": digit, "binding": binding}
    return keys | {"n_frames": 0, "n_frames_total": n_frames, "message": why}
