"""One recording's tips and tip errors, digit by digit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.long_sample import LongSample
from kinematics.recordings import BLOCK_FRAMES, Recordings
from kinematics.rotations import Array
from kinematics.skeleton import DigitChain, Rows, digit_chain
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, RecordingName, recording_name
from schemas.table_rows import TableRows, constant
from stages.evaluate_tips.replay import (
    bind,
    error_statistics,
    replay_first_frame,
    replay_least_squares,
    tip_error_mm,
)

BINDINGS = ("first-frame", "least-squares")


@dataclass(frozen=True)
class Skeleton:
    """One hand under one model: its tables' rows, ready to be replayed.

    joints : joint_centres by joint; bones : bone_lengths by digit and segment; metacarpals : quaternions by
    task, trial and digit, NaN in gaps.
    """

    layout: Layout
    model: SkeletonModel
    joints: Rows
    bones: Mapping[str, Mapping[str, Mapping[str, Any]]]
    metacarpals: TableRows


def evaluate_recording(
    path: Path,
    skeleton: Skeleton,
    rows: list[dict[str, Any]],
    *,
    held_out: bool,
    block_frames: int = BLOCK_FRAMES,
) -> Iterator[dict[str, Any]]:
    """Give the recording's columns of tips, digit by digit in blocks of frames; add its rows of tip_errors.

    A digit that cannot be replayed, or a recording that cannot be read, has rows without numbers that
    say why.
    """
    name = recording_name(path)
    words = {
        "subject": name.subject,
        "hand": name.hand,
        "task": name.task,
        "trial": name.trial,
        "model": skeleton.model.name,
    }
    common = words | {"held_out": held_out, "n_frames": 0, "n_frames_total": 0, "message": ""}
    try:
        recording = Recordings([path], skeleton.layout.measured, block_frames)
        common["n_frames_total"] = recording.n_frames()
    except InputError as error:
        rows += _unavailable(common, tuple(skeleton.layout.digits), str(error))
        return
    for digit in skeleton.layout.digits.values():
        chain = digit_chain(digit, skeleton.layout, skeleton.model, skeleton.joints)
        if isinstance(chain, str):
            rows += _unavailable(common, (digit.name,), chain)
            continue
        replay = _Replay(chain, skeleton, recording, name)
        for block in replay.blocks():
            count = len(block["frame"])
            of_digit = words | {"digit": digit.name}
            yield {key: constant(word, count) for key, word in of_digit.items()} | block
        rows += [
            common | {"digit": digit.name, "binding": binding, **_statistics(known_mm, chain)}
            for binding, known_mm in replay.errors.items()
        ]


class _Replay:
    """A digit replayed through a recording; errors : of either binding, where they are known, in mm."""

    def __init__(
        self, chain: DigitChain, skeleton: Skeleton, recording: Recordings, name: RecordingName
    ) -> None:
        self._chain, self._skeleton, self._recording, self._name = chain, skeleton, recording, name
        self.errors = {binding: LongSample() for binding in BINDINGS}

    def blocks(self) -> Iterator[dict[str, Any]]:
        """Give the columns of tips from frame on."""
        chain = self._chain
        layout, model = self._skeleton.layout, self._skeleton.model
        measured = layout.segments[chain.digit.segments[0]].measured
        at_rest = not measured and model.unmeasured == "rest"
        bones = self._skeleton.bones[chain.digit.name]
        binding = next(filter(None, (bind(chain, *block) for block in self._seen())), None)
        for poses, metacarpal in self._seen():
            bound = replay_first_frame(chain, poses, metacarpal, at_rest=at_rest, binding=binding)
            tip = replay_least_squares(chain, bones, poses, metacarpal)
            errors = [tip_error_mm(found, chain, poses) for found in (bound, tip)]
            for known_mm, error_mm in zip(self.errors.values(), errors, strict=True):
                known_mm.add_known(error_mm)
            yield {
                "frame": poses.frame,
                "time_s": poses.time_s,
                **{f"tip_{axis}_mm": tip[:, index] for index, axis in enumerate("xyz")},
                "error_mm": errors[1],
                "error_first_frame_mm": errors[0],
            }

    def _seen(self) -> Iterator[tuple[Poses, Array | None]]:
        """Blocks of frames and the metacarpal's posture (T, 4) in them, if the digit has one."""
        digit, name = self._chain.digit, self._name
        posture = None
        if digit.metacarpal:
            posture = self._skeleton.metacarpals.of(name.task, name.trial, digit.name)
        for poses in self._recording.blocks(digit.base, *digit.segments):
            turn = None if posture is None else np.asfortranarray(posture.take(len(poses.frame)))
            yield poses, turn


def _statistics(known_mm: LongSample, chain: DigitChain) -> dict[str, Any]:
    found = error_statistics(known_mm)
    if not found["n_frames"]:
        receivers = ", ".join((chain.digit.base, *chain.receivers))
        found["message"] = f"no frame in which all of {receivers} are valid"
    return found


def _unavailable(common: Mapping[str, Any], digits: tuple[str, ...], reason: str) -> list[dict[str, Any]]:
    return [
        {**common, "digit": digit, "binding": binding, "message": reason}
        for digit in digits
        for binding in BINDINGS
    ]
