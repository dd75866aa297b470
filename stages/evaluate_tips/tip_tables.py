"""One recording's rows of the tips and tip_errors tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError, TableError
from shukotsu.schemas.catalogue import METACARPALS
from shukotsu.schemas.parts import Part, PartsWriter, open_parts
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import Poses, PosesReader, frame_count, poses_reader
from shukotsu.sentences.translation import listed
from shukotsu.skeleton.digit_chain import DigitChain, digit_chain
from shukotsu.skeleton.posed_recording import read_skeleton
from shukotsu.skeleton.posing import Skeleton, receiver_bones, root_names
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.evaluate_tips.replay import (
    FirstFrame,
    error_statistics,
    first_frame,
    tip_error_mm,
    tip_first_frame,
    tips_least_squares,
    usable_frames,
)

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
        receivers = [own for own in digit.segments if skeleton.layout.segments[own].measured]
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
        for own, error_mm in zip(self._errors_mm.values(), errors_mm, strict=True):
            own.append(error_mm)
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
        found = {binding: np.concatenate(own) for binding, own in self._errors_mm.items()}
        least_squares_mm = found[BINDINGS[1]]
        why, needed = "", (chain.digit.base, *chain.receivers)
        if not np.isfinite(least_squares_mm).any():  # receivers that were not worn, or never all at once
            absent = [name for name in needed if name not in self._seen]
            why = f"no frame in which all of {listed(needed)} are valid"
            if absent:
                why = f"the recording has no pose of {listed(absent)}, which the replay rides on"
        return [
            _row(chain.digit.name, binding, len(error_mm), why) | error_statistics(error_mm)
            for binding, error_mm in found.items()
        ]


def unavailable_rows(digit: str, reason: str, n_frames: int = 0) -> list[dict[str, Any]]:
    """Rows of tip_errors of a digit without numbers, and why."""
    return [_row(digit, binding, n_frames, reason) for binding in BINDINGS]


def _row(digit: str, binding: str, n_frames: int, why: str) -> dict[str, Any]:
    keys = {"digit": digit, "binding": binding}
    return keys | {"n_frames": 0, "n_frames_total": n_frames, "message": why}
