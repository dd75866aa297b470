"""BVH (Biovision hierarchy) for animation programs: bones and their rotations, with a text file of facts.

The HIERARCHY is the skeleton at rest, with the root's bone frame along the world's axes: fingers straight
towards -Z, the back of the hand up (+Y). A joint's rotations start from this pose. Channels are Zrotation,
Yrotation, Xrotation, so R = Rz Ry Rx: a finger's flexion is about X and may exceed 90 deg; its deviation is
about Y, the middle angle, which may not. Angles are continuous over time and may leave (-180, 180].

A joint that stays at its OFFSET has these three channels. A joint that moves relative to the bone before it
is written as two: NAME_rest, which has the OFFSET and never rotates, and in it NAME with positions, rotations
and an OFFSET of zero. This is because programs disagree on positions in addition to an OFFSET: in Blender and
bvhsdk they replace it, in three.js they are added. `--bones stiff` writes rotations only. The last tip of a
digit is an End Site or, if it moves, a joint with an End Site of zero length: the End Site after index_tip,
the end of the bone, is the end of the skin. The root's OFFSET is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shukotsu.errors import count_of
from shukotsu.export import exported_motion
from shukotsu.export.exported_motion import ALONE_HZ, MOVES_MM
from shukotsu.export.gaps import largest_time_error_s
from shukotsu.export.registry import FORMATS
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import Array, conjugate, multiply, turn_angles
from shukotsu.tables.whole_files import replacing, write_text

NUMBER = "%.7f"
CM_PER_MM = 0.1

AT_REST = "_rest"
"""Suffix of the joint that has the OFFSET of a moving joint."""

_PLACES, _TURNS = "Xposition Yposition Zposition", "Zrotation Yrotation Xrotation"
TURN_AXES = np.eye(3)[::-1]
"""Axes of these rotations; each axis is rotated by the rotations before it."""

_TEXT_FRAMES = 1024
_NOTABLE_S = 5e-4


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Write a motion without gaps as one file, in cm with y up; return sentences on what the file lacks.

    Raises InputError if a pose is missing, if there is no frame, or if several frames have no known rate.
    """
    exported_motion.require_whole(motion, path, "BVH")
    exported_motion.require_rate(motion, path, "BVH")
    seconds = 1.0 / (motion.rate_hz if np.isfinite(motion.rate_hz) else ALONE_HZ)
    rest_mm, rest_turn = exported_motion.rest_pose(motion)
    offset_mm = rest_mm.copy()
    offset_mm[1:] -= rest_mm[motion.parents[1:]]
    # bone frames rotated back by their rest rotations, so that at rest all are parallel to the world's frame
    world = motion.quaternion.copy()
    for index, turn in enumerate(rest_turn):
        world[:, index] = multiply(world[:, index], conjugate(turn))
    local_mm, local = exported_motion.local_motion(replace(motion, quaternion=world))
    moves = np.zeros(len(offset_mm), bool)
    channels: list[tuple[Array, str]] = []  # values (T, 3) and their format
    order, left = list[int](), [0]
    while left:  # depth first, the order of a BVH hierarchy
        order.append(left.pop())
        left += np.flatnonzero(motion.parents == order[-1])[::-1].tolist()
    for index in order:
        beyond = (local_mm[:, index] - (offset_mm[index] if index else 0.0)) * CM_PER_MM
        moves[index] = not index or np.abs(beyond).max() > MOVES_MM * CM_PER_MM
        if moves[index]:
            if index:  # the joint NAME_rest, which never rotates
                channels.append((np.zeros_like(beyond), "%.0f"))
            channels.append((beyond, NUMBER))
        if moves[index] or not _is_end(motion, index):
            channels.append((np.degrees(turn_angles(local[:, index], TURN_AXES)), NUMBER))
    numbers = np.concatenate([values for values, _ in channels], 1)
    pattern = " ".join(number for _, number in channels for _ in range(3)) + "\n"
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in _hierarchy(motion, offset_mm * CM_PER_MM, moves))
        stream.write(f"MOTION\nFrames: {len(motion.frame)}\nFrame Time: {seconds:.10f}\n")
        for start in range(0, len(motion.frame), _TEXT_FRAMES):
            part = numbers[start : start + _TEXT_FRAMES]
            stream.write(pattern * len(part) % tuple(part.ravel().tolist()))
    dropped = _losses(motion, moves)
    facts = exported_motion.facts_text(motion, "cm", "y", (FORMATS["bvh"].drops, *dropped))
    write_text(path.with_name(f"{path.name}.txt"), facts)
    return dropped


def _is_end(motion: PosedRecording, index: int) -> bool:
    """Return whether a joint is a digit's last tip, which can be an End Site."""
    return motion.joints[index].tip and index not in motion.parents


def _hierarchy(motion: PosedRecording, offset: Array, moves: Array) -> list[str]:
    def block(head: str, values: Array, channels: str, inner: Sequence[str]) -> list[str]:
        offset_line = "OFFSET " + " ".join(NUMBER % value for value in values)
        lines = (offset_line, *([f"CHANNELS {channels}"] if channels else []), *inner)
        return [head, "{", *(f"\t{line}" for line in lines), "}"]

    def below(index: int) -> list[str]:
        children = np.flatnonzero(motion.parents == index).tolist()
        name, apart = exported_motion.ascii_name(motion.names[index]), bool(index and moves[index])
        at = np.zeros(3) if apart or not index else offset[index]
        if _is_end(motion, index) and not moves[index]:
            return block("End Site", at, "", [])
        inner = [line for child in children for line in below(child)]
        inner = inner or block("End Site", np.zeros(3), "", [])
        channels = f"6 {_PLACES} {_TURNS}" if moves[index] else f"3 {_TURNS}"
        joint = block(f"{'JOINT' if index else 'ROOT'} {name}", at, channels, inner)
        return block(f"JOINT {name}{AT_REST}", offset[index], f"3 {_TURNS}", joint) if apart else joint

    return ["HIERARCHY", *below(0)]


def _losses(motion: PosedRecording, moves: Array) -> tuple[str, ...]:
    sentences = []
    moving = [motion.names[i] for i in range(1, len(moves)) if moves[i]]
    if moving:
        sentences.append(
            f"rotations alone: {count_of(len(moving), 'joint', 'move')} relative to the parent bone and so "
            "have positions, in an additional joint; --bones stiff keeps bone lengths constant"
        )
    late_s = largest_time_error_s(motion)
    if late_s > _NOTABLE_S:
        sentences.append(
            f"device times, which differ by up to {late_s * 1000:.1f} ms from the constant Frame Time; --fps "
            "resamples over device time"
        )
    return tuple(sentences)
