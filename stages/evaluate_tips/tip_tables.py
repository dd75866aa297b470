"""One recording's rows of the tips and tip_errors tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shukotsu.schemas.poses import Poses, PosesReader
from shukotsu.sentences.messages import message_of
from shukotsu.skeleton.digit_chain import DigitChain, digit_chain
from shukotsu.skeleton.posing import Skeleton, receiver_bones, root_names
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.evaluate_tips.replay import (
    error_statistics,
    tip_error_mm,
    tip_first_frame,
    tips_least_squares,
    usable_frames,
)

BINDINGS = ("first-frame", "least-squares")


@dataclass(frozen=True)
class DigitReplay:
    """One digit replayed: its columns of tips, and its rows of tip_errors (keys of the recording left out).

    columns is None for a digit that cannot be replayed; its rows say why.
    """

    columns: dict[str, Any] | None
    rows: list[dict[str, Any]]


def replay_recording(
    skeleton: Skeleton, recording: PosesReader, metacarpals: Mapping[str, Array]
) -> Iterator[DigitReplay]:
    """Replay every digit of the layout in a recording. metacarpals : quaternions (T, 4) by digit.

    A digit at a time, for the bones of all take several times the memory of the recording.
    """
    for digit in skeleton.layout.digits.values():
        alone = replace(skeleton, layout=replace(skeleton.layout, digits={digit.name: digit}))
        chain = digit_chain(digit, skeleton.layout, skeleton.model, skeleton.joints)
        receivers = [own for own in digit.segments if skeleton.layout.segments[own].measured]
        (poses,) = recording(*dict.fromkeys([root_names(skeleton.layout)[1], digit.base, *receivers]))
        bones = receiver_bones(alone, poses, metacarpals)
        reason = chain if isinstance(chain, str) else bones.left_out.get(digit.name)
        if isinstance(chain, str) or reason is not None:
            yield DigitReplay(None, unavailable_rows(digit.name, reason or "", len(poses.frame)))
        else:
            metacarpal = metacarpals.get(digit.name) if digit.metacarpal else None
            tip_mm = tips_least_squares(bones)[digit.name]
            del bones
            yield _replay_digit(skeleton, chain, poses, metacarpal, tip_mm)


def _replay_digit(
    skeleton: Skeleton, chain: DigitChain, poses: Poses, metacarpal: Array | None, tip_mm: Array
) -> DigitReplay:
    measured = skeleton.layout.segments[chain.digit.segments[0]].measured
    at_rest = not measured and skeleton.model.metacarpals.unmeasured == "rest"
    tip_mm = np.where(usable_frames(chain, poses, metacarpal)[:, None], tip_mm, np.nan)
    tips_mm = (tip_first_frame(chain, poses, metacarpal, at_rest=at_rest), tip_mm)
    first_frame_mm, least_squares_mm = (tip_error_mm(tip, chain, poses) for tip in tips_mm)
    columns = {
        "digit": chain.digit.name,
        "frame": poses.frame,
        "time_s": poses.time_s,
        **{f"tip_{axis}_mm": tip_mm[:, index] for index, axis in enumerate("xyz")},
        "error_mm": least_squares_mm,
        "error_first_frame_mm": first_frame_mm,
    }
    why = "" if np.isfinite(least_squares_mm).any() else _why_unscored(chain, poses)
    rows = [
        _row(chain.digit.name, binding, len(poses.frame), why) | error_statistics(error_mm)
        for binding, error_mm in zip(BINDINGS, (first_frame_mm, least_squares_mm), strict=True)
    ]
    return DigitReplay(columns, rows)


def _why_unscored(chain: DigitChain, poses: Poses) -> str:
    """Say why no frame of a recording can be replayed: receivers that were not worn, or never all at once."""
    needed = (chain.digit.base, *chain.receivers)
    absent = [name for name in needed if not poses.valid[:, poses.index(name)].any()]
    if absent:
        return message_of("no-pose-to-replay", segments=absent)
    return message_of("never-together", segments=needed)


def unavailable_rows(digit: str, reason: str, n_frames: int = 0) -> list[dict[str, Any]]:
    """Rows of tip_errors of a digit without numbers, and why."""
    return [_row(digit, binding, n_frames, reason) for binding in BINDINGS]


def _row(digit: str, binding: str, n_frames: int, why: str) -> dict[str, Any]:
    return {
        "digit": digit,
        "binding": binding,
        "n_frames": 0,
        "n_frames_total": n_frames,
        "message": why,
    }
