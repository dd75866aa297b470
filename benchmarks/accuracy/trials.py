"""One simulated hand recorded in one scenario, with its truth, as arrays that every estimator gets."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from benchmarks.accuracy.polynomial_skin import slipped
from benchmarks.accuracy.scenarios import SATURATING, Scenario
from schemas.layout import read_layout
from schemas.poses import Poses
from skeleton.rotations import Array, unit
from stages.simulate.artefact import distorted, noisy, seen_through_skin, skin_of, turned, under_read
from stages.simulate.forward import bone_poses
from stages.simulate.mounts import Mounts, mounts_of
from stages.simulate.random_hand import DIGITS, FINGERS, FLEXION, JOINTS, Hand, hand_of
from stages.simulate.randomness import generator
from stages.simulate.realism import Realism
from stages.simulate.simulated_truth import Truth
from stages.simulate.simulation import FIRST_FRAME, LAYOUT
from stages.simulate.task_motion import RATE_HZ, Motion, move

SUBJECT = "01"
N_FRAMES = 6000
_BURST_S = 0.25


@dataclass(frozen=True)
class Trial:
    """A recording of one hand and what its estimators are told; the truth is for the judge alone."""

    seed: int
    hand: str
    scenario: Scenario
    poses: Poses
    truth: Truth
    hand_length_mm: float | None


def record(seed: int, hand: str, scenario: Scenario, n_frames: int = N_FRAMES) -> Trial:
    """Simulate a hand in a scenario; with the default scenario exactly what `stages.simulate` makes."""
    realism = Realism(artefact=scenario.artefact, field_distortion=scenario.field, mounts=scenario.mounts)
    layout = read_layout(LAYOUT)
    segments = tuple(s for s in layout.measured if not layout.segments[s].optional)
    anatomy = hand_of(SUBJECT, hand, seed, realism)
    mounts = mounts_of(SUBJECT, hand, seed, anatomy, segments, realism)
    motion = move(SUBJECT, hand, scenario.task, seed, anatomy, realism, n_frames)
    if scenario.dip_range_deg is not None:
        motion = replace(motion, angles_rad=with_dip_range(motion.angles_rad, scenario.dip_range_deg))
    bones = bone_poses(anatomy, motion.angles_rad, motion.wrist_mm, motion.forearm)
    recorded = _through_skin(anatomy, mounts, motion, bones, seed, hand, scenario)
    if scenario.cross_talk:
        recorded = _cross_talk(recorded, segments, motion.angles_rad, scenario.cross_talk, seed, hand)
    if scenario.field:
        recorded = distorted(*recorded, seed, scenario.field)
    recorded = noisy(*recorded, realism.noise, generator(seed, "noise", SUBJECT, hand, scenario.task))
    truth = Truth.of(layout, anatomy, mounts, motion.angles_rad, bones, recorded, realism)
    share = scenario.told_length
    length_mm = None if share is None else share * true_length_mm(anatomy)
    return Trial(seed, hand, scenario, _poses(segments, recorded, seed, hand, scenario), truth, length_mm)


def true_length_mm(hand: Hand) -> float:
    """Length of a hand from the wrist centre to the middle finger's soft tip, all bones in line."""
    middle = [i + 1 for i, joint in enumerate(JOINTS) if joint.startswith("middle_")]
    to_base_mm = hand.origin_mm[JOINTS.index("middle_cmc"), 0]
    soft_tip_mm = hand.soft_tip_mm[DIGITS.index("middle")]
    return float(to_base_mm + hand.length_mm[middle].sum() + soft_tip_mm)


def with_dip_range(angles_rad: Array, range_deg: float) -> Array:
    """Joint angles (T, J, 3) with the DIP joints' motion scaled, about the first frame, to a range."""
    scaled = angles_rad.copy()
    for joint in (JOINTS.index(f"{digit}_dip") for digit in FINGERS):
        moved = angles_rad[:, joint] - angles_rad[0, joint]
        scaled[:, joint] = angles_rad[0, joint] + moved * np.radians(range_deg) / np.ptp(moved[:, FLEXION])
    return scaled


def _through_skin(
    anatomy: Hand,
    mounts: Mounts,
    motion: Motion,
    bones: tuple[Array, Array],
    seed: int,
    hand: str,
    scenario: Scenario,
) -> tuple[Array, Array]:
    """Receivers' poses as the scenario's skin lets them follow the bones."""
    if not scenario.artefact:
        return mounts.poses(*bones)
    skin = skin_of(SUBJECT, hand, seed, mounts.segments, scenario.artefact)
    followed = under_read(motion.angles_rad, skin)
    thumb_skin = bone_poses(anatomy, followed, motion.wrist_mm, motion.forearm)
    rng = generator(seed, "wander", SUBJECT, hand, scenario.task)
    if scenario.law == SATURATING:
        return seen_through_skin(mounts, bones, thumb_skin, motion.angles_rad, skin, rng)
    position, quaternion = mounts.poses(*bones)
    own = mounts.segments.index("thumb_metacarpal")
    under = mounts.poses(*thumb_skin)
    position[:, own], quaternion[:, own] = under[0][:, own], under[1][:, own]
    distal = np.array([segment.endswith("_distal") for segment in mounts.segments])
    own_rng = generator(seed, "polynomial skin", SUBJECT, hand)
    return slipped(position, quaternion, motion.angles_rad, skin, scenario.artefact * distal, own_rng)


def _cross_talk(
    recorded: tuple[Array, Array],
    segments: tuple[str, ...],
    angles_rad: Array,
    per_rad: float,
    seed: int,
    hand: str,
) -> tuple[Array, Array]:
    """Poses with the middle phalanges' receivers tilted by the PIP joints, each about an axis of its own."""
    position, quaternion = recorded[0], recorded[1].copy()
    axes = unit(generator(seed, "cross-talk", SUBJECT, hand).standard_normal((len(FINGERS), 3)))
    for axis, digit in zip(axes, FINGERS, strict=True):
        receiver = segments.index(f"{digit}_middle")
        bent = angles_rad[:, JOINTS.index(f"{digit}_pip"), FLEXION]
        quaternion[:, receiver] = turned(quaternion[:, receiver], per_rad * bent[:, None] * axis)
    return position, quaternion


def _poses(
    segments: tuple[str, ...], recorded: tuple[Array, Array], seed: int, hand: str, scenario: Scenario
) -> Poses:
    """The recording as the stages hold it, with what the tracker lost; lost poses are NaN."""
    position_mm, quaternion = recorded[0].copy(), recorded[1].copy()
    n_frames = len(position_mm)
    rng = generator(seed, "lost", SUBJECT, hand)
    lost = bursts(rng, n_frames, len(segments), scenario.dropped)
    if scenario.half_absent:
        worn = [i for i, segment in enumerate(segments) if segment != "hand"]
        lost[n_frames // 2 :, rng.choice(worn)] = True
    position_mm[lost], quaternion[lost] = np.nan, np.nan
    frame = np.arange(FIRST_FRAME, FIRST_FRAME + n_frames)
    return Poses(segments, frame, frame / RATE_HZ, position_mm, quaternion, ~lost)


def bursts(rng: np.random.Generator, n_frames: int, n_receivers: int, share: float) -> npt.NDArray[np.bool_]:
    """Which frames (T, S) are lost: each receiver loses that share on its own, in bursts of 0.25 s."""
    length = int(_BURST_S * RATE_HZ)
    n_bursts = -(-n_frames // length)
    lost = rng.random((n_bursts, n_receivers)) < share
    return np.repeat(lost, length, axis=0)[:n_frames]
