"""Simulation of one recording: the subject's hand, its motion, the tracker, and the truth.

A true joint centre is the mean over the recording of the centre's position in the frame of the receiver,
which moves on the skin; the same holds for axes and bone directions. The truth does not depend on tracker
noise and field distortion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.arrays import Array
from shukotsu.errors import InputError, count_of
from shukotsu.hand import rotations
from shukotsu.simulate.forward import PoseArrays, bone_poses, flexion_axis, relaxed_angles
from shukotsu.simulate.mounts import Mounts, displace, mounts_of, on_skin, saturating, skin_of
from shukotsu.simulate.random_hand import DIGITS, FLEXION, JOINTS, TIP_BONES, RandomHand, hand_of
from shukotsu.simulate.realism import Realism, generator
from shukotsu.simulate.task_motion import RATE_HZ, TASK_FRAMES, TaskMotion, move
from shukotsu.simulate.tracker_errors import distort, faulty, noisy
from shukotsu.study.layout import Joint, read_layout
from shukotsu.tables.poses import Poses, RecordingName

LAYOUT = "liberty16"


@dataclass(frozen=True)
class TrueJoint:
    """Truth of a joint between two receivers.

    Attributes
    ----------
    name, parent_segment, child_segment : str
        The joint and its segments; parent_segment is empty if it carries no receiver.
    dof : int
        Degrees of freedom.
    parent_mm, child_mm : array, shape (3,)
        Mean centre in the parent's and the child's receiver frame, mm; parent_mm is NaN without a receiver.
    axis_parent, axis_child : array, shape (3,)
        Mean unit flexion axis in either frame.
    range_deg : float
        Range of flexion.
    gap_mm : array, shape (T,)
        Distance in the recording between the centres carried by the two receivers.

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
    """Truth of a simulated recording.

    Attributes
    ----------
    hand, mounts : RandomHand, Mounts
        The hand and its receivers.
    angles_rad : array, shape (T, J, 3)
        Flexion, abduction and axial rotation.
    bone_position_mm, bone_quaternion : array, shape (T, B, 3) and (T, B, 4)
        Bones in the transmitter frame.
    tip_mm, skin_tip_mm : array, shape (T, 5, 3)
        Tips of the distal bones, and of the digits with their soft tissue, in the transmitter frame.
    joints : mapping
        Joint -> its truth.
    along : array, shape (S, 3)
        Mean unit direction of each receiver's bone, in the receiver's frame.

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
        joints: Sequence[Joint],
        hand: RandomHand,
        mounts: Mounts,
        angles_rad: Array,
        bones: PoseArrays,
        ridden: PoseArrays,
        recorded: PoseArrays,
    ) -> Truth:
        """Collect the truth of a recording of T frames.

        Parameters
        ----------
        joints : sequence of Joint
            Joints between receivers, with their degrees of freedom.
        hand, mounts : RandomHand, Mounts
            The hand and its S receivers.
        angles_rad : array, shape (T, J, 3)
            Joint angles.
        bones, ridden, recorded : PoseArrays
            The bones, the receivers on the skin, and the receivers as the tracker reports them.

        Returns
        -------
        Truth
            The truth.

        """
        true_joints = {}
        for joint in joints:
            index = JOINTS.index(joint.name)
            centre_mm = bones[0][:, index + 1]
            axis = flexion_axis(hand, index, angles_rad, bones[1])
            child = mounts.segments.index(joint.child)
            child_mm, axis_child = _in_receiver(ridden, child, centre_mm, axis)
            parent_mm = axis_parent = np.full(3, np.nan)
            gap_mm = np.full(len(axis), np.nan)
            worn = joint.parent_receiver in mounts.segments
            if worn:
                parent = mounts.segments.index(joint.parent_receiver)
                parent_mm, axis_parent = _in_receiver(ridden, parent, centre_mm, axis)
                first_mm, second_mm = (
                    recorded[0][:, receiver] + rotations.rotate(recorded[1][:, receiver], half_mm)
                    for receiver, half_mm in ((parent, parent_mm), (child, child_mm))
                )
                gap_mm = np.linalg.norm(first_mm - second_mm, axis=-1)
            segments = joint.parent_receiver if worn else "", joint.child
            seen = parent_mm, child_mm, axis_parent, axis_child
            range_deg = float(np.degrees(np.ptp(angles_rad[:, index, FLEXION])))
            true_joints[joint.name] = TrueJoint(joint.name, *segments, joint.dof, *seen, range_deg, gap_mm)
        tip_mm = distal_ends_mm(hand.length_mm[TIP_BONES], *bones)
        skin_tip_mm = distal_ends_mm(hand.length_mm[TIP_BONES] + hand.soft_tip_mm, *bones)
        pointing = rotations.rotate(bones[1][:, mounts.bone], np.array([1.0, 0.0, 0.0]))
        along = rotations.unit(rotations.rotate(rotations.conjugate(ridden[1]), pointing).mean(0))
        return cls(hand, mounts, angles_rad, *bones, tip_mm, skin_tip_mm, true_joints, along)


def distal_ends_mm(length_mm: Array, bone_position_mm: Array, bone_quaternion: Array) -> Array:
    """Compute points on the axes of the distal bones.

    Parameters
    ----------
    length_mm : array, shape (5,)
        Distance from each bone's base.
    bone_position_mm, bone_quaternion : array, shape (T, B, 3) and (T, B, 4)
        Bones in the transmitter frame.

    Returns
    -------
    array, shape (T, 5, 3)
        Points in the transmitter frame, mm.

    """
    along = np.zeros((len(DIGITS), 3))
    along[:, 0] = length_mm
    return bone_position_mm[:, TIP_BONES] + rotations.rotate(bone_quaternion[:, TIP_BONES], along)


def _in_receiver(poses: PoseArrays, receiver: int, point_mm: Array, axis: Array) -> tuple[Array, Array]:
    """Return the mean over frames of a point and an axis, (T, 3) each, in a receiver's frame."""
    back = rotations.conjugate(poses[1][:, receiver])
    seen_mm = rotations.rotate(back, point_mm - poses[0][:, receiver]).mean(0)
    return seen_mm, rotations.unit(rotations.rotate(back, axis).mean(0))


@dataclass(frozen=True)
class Simulated(Poses):
    """Poses of a simulated recording, NaN where the tracker lost them, with their truth.

    Attributes
    ----------
    name : RecordingName
        The recording.
    truth : Truth
        The truth.

    """

    name: RecordingName
    truth: Truth


def simulate(
    name: RecordingName,
    seed: int,
    realism: Realism,
    n_frames: int | None = None,
    *,
    forearm: bool = False,
    change: Callable[[TaskMotion], TaskMotion] | None = None,
) -> Simulated:
    """Simulate one recording at 240 Hz with 16 receivers, or 17 with `forearm`.

    Anatomy depends on seed and subject; receiver placement and skin also on the hand; motion and noise also
    on the task. In another session the receivers are placed anew and the subject moves differently.

    Parameters
    ----------
    name : RecordingName
        The recording; hand is right or left, task a key of TASK_FRAMES, and there are no trials.
    seed : int
        Seed, 0 or more.
    realism : Realism
        Degree of realism.
    n_frames : int, optional
        Number of frames, 2 or more; the same movements are then faster or slower.
    forearm : bool
        Whether a receiver is worn on the forearm.
    change : callable, optional
        Modifies the motion of the task.

    Returns
    -------
    Simulated
        Recording and truth.

    Raises
    ------
    InputError
        If an argument is not valid.

    """
    n_frames = _check_arguments(name, seed, n_frames)
    subject, hand, task, session = name.subject, name.hand, name.task, name.session
    layout = read_layout(LAYOUT)
    segments = tuple(s for s in layout.measured if forearm or not layout.segments[s].optional)
    anatomy = hand_of(subject, hand, seed, realism)
    mounts = mounts_of(name, seed, anatomy, segments, realism)
    motion = move(name, seed, anatomy, realism, n_frames)
    if change is not None:
        motion = change(motion)
    bones = bone_poses(anatomy, motion.angles_rad, motion.wrist_mm, motion.forearm)
    ridden = mounts.poses(*bones)
    if realism.artefact:
        skin = skin_of(subject, hand, seed, segments, realism.artefact)
        relaxed = relaxed_angles(anatomy, realism)
        of_hand = generator(seed, "saturating skin", subject, hand)
        of_recording = generator(seed, "wander", subject, hand, task, session=session)
        off = saturating(motion.angles_rad - relaxed, skin, of_hand, of_recording)
        ridden = displace(*on_skin(anatomy, mounts, motion, relaxed, bones, skin), *off)
    recorded = ridden
    if realism.field_distortion:
        recorded = distort(*recorded, seed, realism.field_distortion)
    if realism.noise:
        rng = generator(seed, "noise", subject, hand, task, session=session)
        recorded = noisy(*recorded, realism.noise, rng)
    joints = [replace(joint, dof=1) if realism.paper_joints else joint for joint in layout.solvable]
    truth = Truth.of(joints, anatomy, mounts, motion.angles_rad, bones, ridden, recorded)
    if realism.faults:
        rng = generator(seed, "faults", subject, hand, task, session=session)
        recorded = faulty(*recorded, realism.faults, rng)
    frame, valid = np.arange(1, n_frames + 1), np.asarray(np.isfinite(recorded[0]).all(-1))
    return Simulated(segments, frame, frame / RATE_HZ, *recorded, valid, name, truth)


def _check_arguments(name: RecordingName, seed: int, n_frames: int | None) -> int:
    """Return the number of frames of the recording; raise InputError if an argument is not valid."""
    if name.hand not in ("right", "left"):
        raise InputError(f"hand {name.hand!r} is not known; expected right or left")
    if name.task not in TASK_FRAMES:
        raise InputError(f"task {name.task!r} is not known; expected one of {', '.join(TASK_FRAMES)}")
    if name.trial:
        raise InputError(f"trial {name.trial!r}: a simulated task has no trials; expected none")
    if seed < 0:
        raise InputError(f"seed {seed} is negative; expected 0 or more")
    if n_frames is not None and n_frames < 2:
        raise InputError(f"{count_of(n_frames, 'frame', 'are')} not enough; expected 2 or more")
    return n_frames or TASK_FRAMES[name.task]
