"""Biovision hierarchy: a person's bones and their rotations, for animation programs.

The HIERARCHY is the skeleton at rest, its root's bone frame along the world's axes: fingers straight towards
-Z, the back of the hand up (+Y). A joint's rotations turn its bone from there: none are the rest pose.
Channels are Zrotation, Yrotation, Xrotation, so R = Rz Ry Rx: flexion of a finger is about X, which may go
beyond 90 deg, deviation about Y, which stands in the middle and may not. Angles are continuous over time
and may leave (-180, 180].

A joint that stays at its OFFSET has these three channels. One that moves against the bone before is two:
NAME_rest, which has the OFFSET and never turns, and in it NAME with positions, rotations and an OFFSET of
zero. For programs do not agree on positions beside an OFFSET: Blender and bvhsdk put them in its place,
three.js adds the two. `--bones stiff` gives a file with rotations alone. A tip is an End Site, or
where it moves a joint with an End Site of no length. The root's OFFSET is zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from kinematics.rotations import Array, conjugate, matrix, multiply, rotate
from schemas.errors import InputError
from schemas.files import replacing
from stages.export.axes import UNITS_PER_MM
from stages.export.formats import Target
from stages.export.frames import blocks, slices
from stages.export.motion import SkeletonMotion, rest_pose
from stages.export.names import ascii_name
from stages.export.resampling import largest_time_error_s

MOVES_MM = 1e-5
"""A joint that leaves its OFFSET by more than this gets position channels."""

ANGLE_DECIMALS = 7
LENGTH_DECIMALS = {"m": 8, "cm": 7, "mm": 6}
ALONE_S = 1 / 60
"""Frame Time of a file of one frame, whose rate nobody knows."""

AT_REST = "_rest"
"""Ends the name of the joint that has the OFFSET of one that moves."""

_PLACES, _TURNS = "Xposition Yposition Zposition", "Zrotation Yrotation Xrotation"
_TEXT_FRAMES = 1024
_TOLD_S = 5e-4


def write(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    """Write the motion, which has no gap, as one file; give what it does not hold.

    Frames are streamed, any number of them. Raises InputError where a pose is missing, where there is no
    frame, or no rate is known for more than one.
    """
    if not len(motion.frame) or not motion.whole.all():
        raise InputError(
            f"{path}: BVH holds no frame without a pose and no file without a frame; choose --gaps hold, cut "
            "or interpolate"
        )
    seconds = _frame_time_s(motion, path)
    offset = _rest_offset_mm(motion)
    beyond_mm = [np.abs(_local(block)[0] - offset).max((0, 2)) for block in blocks(motion)]
    moves = np.asarray(np.max(beyond_mm, axis=0) > MOVES_MM)
    moves[0] = True
    root_mm = np.where(np.arange(len(offset))[:, None] > 0, offset, 0.0)
    order = _depth_first(motion)
    scale, decimals = UNITS_PER_MM[target.unit], LENGTH_DECIMALS[target.unit]
    order = [i for i in order if moves[i] or not motion.joints[i].tip]
    angles = EulerAngles()
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        stream.writelines(_hierarchy(motion, offset * scale, moves, decimals))
        stream.write(f"MOTION\nFrames: {len(motion.frame)}\nFrame Time: {seconds:.10f}\n")
        for block in blocks(motion):
            local_mm, turn = _local(block)
            beyond = (local_mm - root_mm) * scale
            columns, pattern = _channels(beyond, angles.zyx_deg(turn), order, moves, decimals)
            for rows in slices(len(columns), _TEXT_FRAMES):
                part = columns[rows]
                stream.write(pattern * len(part) % tuple(part.ravel().tolist()))
    return _dropped(motion, moves)


def euler_zyx_deg(quaternion: Array) -> Array:
    """Angles (T, N, 3) about z, y, x in degrees of rotations (T, N, 4), R = Rz Ry Rx, continuous over time.

    Of the two triples of every rotation, z, y, x and z + 180, 180 - y, x + 180, that which is nearer to the
    frame before; then unwrapped. The first frame has y within [-90, 90]. At 90, where z and x are not told
    apart, x is what z leaves of the rotation.
    """
    return EulerAngles().zyx_deg(quaternion)


class EulerAngles:
    """Gives the angles of `euler_zyx_deg` block by block; remembers how the block before ended."""

    def __init__(self) -> None:
        self._first: Array | None = None  # the last frame's first triple (1, N, 3)
        self._second: Array | None = None  # whether its second one was chosen (N,)
        self._chosen: Array | None = None  # its chosen triple, before whole turns are added (1, N, 3)
        self._turns: Array | None = None  # what was added (1, N, 3)

    def zyx_deg(self, quaternion: Array) -> Array:
        """Angles (n, N, 3) of the next rotations (n, N, 4)."""
        angles = _first_triple(quaternion)
        before = angles[:1] if self._first is None else self._first
        other = angles * np.array([1.0, -1.0, 1.0]) + np.pi
        former = np.concatenate([before, angles[:-1]])
        swapped = _apart(other, former) < _apart(angles, former)
        # the second triple is as far from the second before as the first from the first
        swapped[0] = swapped[0] ^ self._second if self._second is not None else False
        second = np.logical_xor.accumulate(swapped, axis=0)
        chosen = np.where(second[..., None], other, angles)
        step = np.diff(chosen, axis=0, prepend=chosen[:1] if self._chosen is None else self._chosen)
        near = np.mod(step + np.pi, 2 * np.pi) - np.pi
        near = np.where((near == -np.pi) & (step > 0), np.pi, near)
        added = np.where(np.abs(step) < np.pi, 0.0, near - step)
        if self._turns is not None:
            added[:1] += self._turns
        added = np.cumsum(added, axis=0)
        whole = chosen + added
        if self._first is None:
            whole[0] = chosen[0]  # to the sign of a zero
        self._first, self._second = angles[-1:], second[-1]
        self._chosen, self._turns = chosen[-1:], added[-1:]
        return np.asarray(np.degrees(whole))


def _first_triple(quaternion: Array) -> Array:
    """Angles (n, N, 3) about z, y, x in rad, y within [-90, 90] deg."""
    m = matrix(quaternion)
    z = np.arctan2(m[..., 1, 0], m[..., 0, 0])
    y = np.arctan2(-m[..., 2, 0], np.hypot(m[..., 0, 0], m[..., 1, 0]))
    x = np.arctan2(
        np.sin(z) * m[..., 0, 2] - np.cos(z) * m[..., 1, 2],
        np.cos(z) * m[..., 1, 1] - np.sin(z) * m[..., 0, 1],
    )
    return np.stack([z, y, x], -1)


def _apart(first: Array, second: Array) -> Array:
    """Sum of three angles' distances (...) in rad, whole turns aside."""
    return np.asarray(np.abs(np.mod(first - second + np.pi, 2 * np.pi) - np.pi).sum(-1))


def _frame_time_s(motion: SkeletonMotion, path: Path) -> float:
    if np.isfinite(motion.rate_hz):
        return 1.0 / motion.rate_hz
    if len(motion.frame) == 1:
        return ALONE_S
    raise InputError(f"{path}: the recording has no device time, and BVH needs a rate; say it with --rate-hz")


def _rest_offset_mm(motion: SkeletonMotion) -> Array:
    """Rest offsets (J, 3) mm, in frames that stand like the world's at rest."""
    rest_mm, _ = rest_pose(motion)
    offset = rest_mm.copy()
    offset[1:] -= rest_mm[motion.parents[1:]]
    return offset


def _local(motion: SkeletonMotion) -> tuple[Array, Array]:
    """Positions (T, J, 3) mm and rotations (T, J, 4) of each joint in its parent.

    In frames that stand like the world's at rest: each bone's own, turned back by its rest rotation.
    """
    _, rest_turn = rest_pose(motion)
    parents = motion.parents
    world = multiply(motion.quaternion, conjugate(rest_turn))
    local_mm, turn = motion.position_mm.copy(), world.copy()
    back = conjugate(world[:, parents[1:]])
    local_mm[:, 1:] = rotate(back, motion.position_mm[:, 1:] - motion.position_mm[:, parents[1:]])
    turn[:, 1:] = multiply(back, world[:, 1:])
    return local_mm, turn


def _depth_first(motion: SkeletonMotion) -> list[int]:
    """Joints in the order in which a hierarchy names them."""
    children = _children(motion)

    def below(index: int) -> Iterator[int]:
        yield index
        for child in children[index]:
            yield from below(child)

    return list(below(0))


def _children(motion: SkeletonMotion) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in motion.joints]
    for index, joint in enumerate(motion.joints[1:], 1):
        children[joint.parent].append(index)
    return children


def _channels(
    length: Array, angle_deg: Array, order: Sequence[int], moves: Array, decimals: int
) -> tuple[Array, str]:
    """All channels (T, C), joint by joint in that order, and the pattern of a frame's line."""
    parts, words = [], []
    for index in order:
        if moves[index] and index:
            parts.append(np.zeros_like(angle_deg[:, index]))
            words += ["%.0f"] * 3
        if moves[index]:
            parts.append(length[:, index])
            words += [f"%.{decimals}f"] * 3
        parts.append(angle_deg[:, index])
        words += [f"%.{ANGLE_DECIMALS}f"] * 3
    return np.concatenate(parts, 1), " ".join(words) + "\n"


def _hierarchy(motion: SkeletonMotion, offset: Array, moves: Array, decimals: int) -> Iterator[str]:
    children = _children(motion)

    def line(depth: int, words: str) -> str:
        return "\t" * depth + words + "\n"

    def offset_of(values: Array) -> str:
        return "OFFSET " + " ".join(f"{value:.{decimals}f}" for value in values)

    def below(index: int, depth: int) -> Iterator[str]:
        joint, ends = motion.joints[index], not children[index]
        site, name = joint.tip and not moves[index], ascii_name(joint.name)
        apart = bool(index and moves[index])
        if apart:
            yield line(depth, f"JOINT {name}{AT_REST}")
            yield line(depth, "{")
            yield line(depth + 1, offset_of(offset[index]))
            yield line(depth + 1, f"CHANNELS 3 {_TURNS}")
            depth += 1
        yield line(depth, "End Site" if site else f"{'JOINT' if index else 'ROOT'} {name}")
        yield line(depth, "{")
        yield line(depth + 1, offset_of(np.zeros(3) if apart or not index else offset[index]))
        if not site:
            yield line(
                depth + 1, f"CHANNELS 6 {_PLACES} {_TURNS}" if moves[index] else f"CHANNELS 3 {_TURNS}"
            )
            for child in children[index]:
                yield from below(child, depth + 1)
            if ends:
                yield line(depth + 1, "End Site")
                yield line(depth + 1, "{")
                yield line(depth + 2, offset_of(np.zeros(3)))
                yield line(depth + 1, "}")
        yield line(depth, "}")
        if apart:
            yield line(depth - 1, "}")

    yield "HIERARCHY\n"
    yield from below(0, 0)


def _dropped(motion: SkeletonMotion, moves: Array) -> tuple[str, ...]:
    sentences = []
    moving = [motion.names[i] for i in range(1, len(moves)) if moves[i]]
    if moving:
        sentences.append(
            f"a skeleton of rotations alone: {len(moving)} joints move against the bone before and have "
            "positions, in a joint of their own; --bones stiff keeps bones at their length"
        )
    late_s = largest_time_error_s(motion)
    if late_s > _TOLD_S:
        sentences.append(
            f"device times, which are up to {late_s * 1000:.1f} ms off the even Frame Time; --fps resamples "
            "over them"
        )
    return tuple(sentences)
