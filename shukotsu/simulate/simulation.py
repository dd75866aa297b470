"""The simulation from end to end: a subject's hand, its motion, what a tracker makes of it, and the truth.

A joint's true centre is stated where it was on average over the recording, in the receiver's frame as the
receiver rode on the skin; axes and the bones' directions likewise. Tracker and field have no part in that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.hand import rotations
from shukotsu.hand.rotations import Array
from shukotsu.simulate.forward import bone_poses, flexion_axis, relaxed_angles
from shukotsu.simulate.mounts import Mounts, displace, mounts_of, on_skin, saturating, skin_of
from shukotsu.simulate.random_hand import DIGITS, FLEXION, JOINTS, TIP_BONES, RandomHand, hand_of
from shukotsu.simulate.realism import Realism, generator
from shukotsu.simulate.task_motion import RATE_HZ, TASK_FRAMES, TaskMotion, move
from shukotsu.simulate.tracker_errors import distort, faulty, noisy
from shukotsu.study.layout import Layout, read_layout
from shukotsu.tables.poses import Poses

LAYOUT = "liberty16"
FIRST_FRAME = 1


@dataclass(frozen=True)
class TrueJoint:
    """A joint between two receivers: its centre and flexion axis in their frames, in the mean; NaN without a
    parent's.

    range_deg : of flexion. gap_mm : (T,) distance between the two centres in the recording.
    """

    name: str
    parent_segment: str
    child_segment: str
    dof: int
    parent_mm: Array
    child_mm: Array
    axis_parent: Array
    axis_child: Array
    range_deg: float
    gap_mm: Array


@dataclass(frozen=True)
class Truth:
    """Everything that the simulation knows.

    angles_rad : (T, J, 3). bone_position_mm (T, B, 3), bone_quaternion (T, B, 4) : in the transmitter frame.
    tip_mm, skin_tip_mm : (T, 5, 3) tips of the bones, and of the digits. along : (S, 3) where the bone of
    each receiver points, in its frame.
    """

    hand: RandomHand
    mounts: Mounts
    angles_rad: Array
    bone_position_mm: Array
    bone_quaternion: Array
    tip_mm: Array
    skin_tip_mm: Array
    joints: Mapping[str, TrueJoint]
    along: Array

    @classmethod
    def of(
        cls,
        layout: Layout,
        hand: RandomHand,
        mounts: Mounts,
        angles_rad: Array,
        bones: tuple[Array, Array],
        ridden: tuple[Array, Array],
        recorded: tuple[Array, Array],
        realism: Realism,
    ) -> Truth:
        """The truth of a recording; ridden, recorded : receivers on the skin, and as the tracker has them."""
        joints = {}
        for joint in layout.solvable:
            index = JOINTS.index(joint.name)
            centre_mm = bones[0][:, index + 1]
            axis = flexion_axis(hand, index, angles_rad, bones[1])
            child = mounts.segments.index(joint.child)
            child_mm, axis_child = _in_receiver(ridden, child, centre_mm, axis)
            parent_mm, axis_parent, gap_mm = (
                np.full(3, np.nan),
                np.full(3, np.nan),
                np.full(len(axis), np.nan),
            )
            worn = joint.parent_receiver in mounts.segments
            if worn:
                parent = mounts.segments.index(joint.parent_receiver)
                parent_mm, axis_parent = _in_receiver(ridden, parent, centre_mm, axis)
                apart = _to_transmitter(recorded, parent, parent_mm) - _to_transmitter(
                    recorded, child, child_mm
                )
                gap_mm = np.linalg.norm(apart, axis=-1)
            joints[joint.name] = TrueJoint(
                joint.name,
                joint.parent_receiver if worn else "",
                joint.child,
                1 if realism.hinges_only else joint.dof,
                parent_mm,
                child_mm,
                axis_parent,
                axis_child,
                float(np.degrees(np.ptp(angles_rad[:, index, FLEXION]))),
                gap_mm,
            )
        tip_mm = _ends_mm(hand.length_mm[TIP_BONES], *bones)
        skin_tip_mm = _ends_mm(hand.length_mm[TIP_BONES] + hand.soft_tip_mm, *bones)
        pointing = rotations.rotate(bones[1][:, mounts.bone], np.array([1.0, 0.0, 0.0]))
        along = rotations.unit(rotations.rotate(rotations.conjugate(ridden[1]), pointing).mean(0))
        return cls(hand, mounts, angles_rad, *bones, tip_mm, skin_tip_mm, joints, along)


def _ends_mm(length_mm: Array, bone_position_mm: Array, bone_quaternion: Array) -> Array:
    """Points (T, 5, 3) in the transmitter frame, so far (5,) along the last bones from their joints."""
    along = np.zeros((len(DIGITS), 3))
    along[:, 0] = length_mm
    return bone_position_mm[:, TIP_BONES] + rotations.rotate(bone_quaternion[:, TIP_BONES], along)


def _in_receiver(
    poses: tuple[Array, Array], receiver: int, point_mm: Array, axis: Array
) -> tuple[Array, Array]:
    """Mean over the frames of points and axes (T, 3) seen from a receiver."""
    back = rotations.conjugate(poses[1][:, receiver])
    seen_mm = rotations.rotate(back, point_mm - poses[0][:, receiver]).mean(0)
    return seen_mm, rotations.unit(rotations.rotate(back, axis).mean(0))


def _to_transmitter(poses: tuple[Array, Array], receiver: int, point_mm: Array) -> Array:
    return np.asarray(poses[0][:, receiver] + rotations.rotate(poses[1][:, receiver], point_mm))


@dataclass(frozen=True)
class Simulated:
    """A recording of T frames and its truth; NaN where the tracker lost a pose."""

    subject: str
    hand: str
    task: str
    frame: npt.NDArray[np.int64]
    time_s: Array
    segments: tuple[str, ...]
    position_mm: Array
    quaternion: Array
    truth: Truth
    session: str = ""

    @property
    def distal_mm(self) -> Array:
        """Origins (T, 5, 3) of the digits' distal receivers."""
        return self.position_mm[:, [self.segments.index(f"{digit}_distal") for digit in DIGITS]]

    def poses(self) -> Poses:
        """The recording as the stages hold it; a pose that the tracker lost is not valid."""
        valid = np.asarray(np.isfinite(self.position_mm).all(-1))
        return Poses(self.segments, self.frame, self.time_s, self.position_mm, self.quaternion, valid)


def simulate(
    subject: str,
    hand: str,
    task: str,
    seed: int,
    realism: Realism,
    n_frames: int | None = None,
    *,
    forearm: bool = False,
    session: str = "",
    change: Callable[[TaskMotion], TaskMotion] | None = None,
) -> Simulated:
    """Simulate one recording with 16 receivers, 17 with `forearm`, at 240 Hz.

    Anatomy depends on seed and subject, receivers' places and skin also on the hand, motion and noise also on
    the task. In another session the person moves anew, with receivers put on anew. Another n_frames than the
    task's own is the same script, faster or slower. change : of what the task makes the hand do. Raises
    InputError where an argument is not usable.
    """
    n_frames = _check_arguments(hand, task, seed, n_frames)
    layout, in_session = read_layout(LAYOUT), [session] * bool(session)
    segments = tuple(s for s in layout.measured if forearm or not layout.segments[s].optional)
    anatomy = hand_of(subject, hand, seed, realism)
    mounts = mounts_of(subject, hand, seed, anatomy, segments, realism, session)
    motion = move(subject, hand, task, seed, anatomy, realism, n_frames, session)
    if change is not None:
        motion = change(motion)
    bones = bone_poses(anatomy, motion.angles_rad, motion.wrist_mm, motion.forearm)
    ridden = mounts.poses(*bones)
    if realism.artefact:
        skin = skin_of(subject, hand, seed, segments, realism.artefact)
        relaxed = relaxed_angles(anatomy, realism)
        of_hand = generator(seed, "saturating skin", subject, hand)
        of_recording = generator(seed, "wander", subject, hand, task, *in_session)
        off = saturating(motion.angles_rad - relaxed, skin, of_hand, of_recording)
        ridden = displace(*on_skin(anatomy, mounts, motion, relaxed, bones, skin), *off)
    recorded = ridden
    if realism.field_distortion:
        recorded = distort(*recorded, seed, realism.field_distortion)
    if realism.noise:
        rng = generator(seed, "noise", subject, hand, task, *in_session)
        recorded = noisy(*recorded, realism.noise, rng)
    truth = Truth.of(layout, anatomy, mounts, motion.angles_rad, bones, ridden, recorded, realism)
    if realism.faults:
        rng = generator(seed, "faults", subject, hand, task, *in_session)
        recorded = faulty(*recorded, realism.faults, rng)
    frame = np.arange(FIRST_FRAME, FIRST_FRAME + n_frames)
    return Simulated(subject, hand, task, frame, frame / RATE_HZ, segments, *recorded, truth, session)


def _check_arguments(hand: str, task: str, seed: int, n_frames: int | None) -> int:
    """The number of frames; InputError where an argument is not usable."""
    if hand not in ("right", "left"):
        raise InputError(f"hand {hand!r} is not known; expected right or left")
    if task not in TASK_FRAMES:
        raise InputError(f"task {task!r} is not known; expected one of {', '.join(TASK_FRAMES)}")
    if seed < 0:
        raise InputError(f"seed {seed} is negative; expected 0 or more")
    if n_frames is not None and n_frames < 2:
        raise InputError(f"{n_frames} frames are no motion; expected 2 or more")
    return n_frames or TASK_FRAMES[task]
