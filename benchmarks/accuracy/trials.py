"""One simulated hand recorded in one scenario, with its truth, as arrays that every estimator gets."""

from __future__ import annotations

from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy.typing as npt

from benchmarks.accuracy.scenarios import Scenario
from shukotsu.anatomy.drawn_hands import CREASE_MM
from shukotsu.schemas.poses import Poses, read_poses
from shukotsu.skeleton.rotations import Array, unit
from shukotsu.stages.capture import import_recording
from shukotsu.stages.simulate.random_hand import DIGITS, FINGERS, FLEXION, JOINTS, Hand
from shukotsu.stages.simulate.randomness import generator
from shukotsu.stages.simulate.recording import write_recording
from shukotsu.stages.simulate.simulated_truth import Truth
from shukotsu.stages.simulate.simulation import LAYOUT, Simulated, simulate
from shukotsu.stages.simulate.task_motion import RATE_HZ, Motion
from shukotsu.stages.simulate.tracker_errors import turned

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

    def change(motion: Motion) -> Motion:
        if scenario.dip_range_deg is None:
            return motion
        return replace(motion, angles_rad=with_dip_range(motion.angles_rad, scenario.dip_range_deg))

    made = simulate(SUBJECT, hand, scenario.task, seed, scenario.realism, n_frames, change=change)
    if scenario.cross_talk:
        made = _with_cross_talk(made, scenario.cross_talk, seed)
    share = scenario.told_length
    length_mm = None if share is None else share * true_length_mm(made.truth.hand)
    poses = _imported(made) if scenario.realism.faults else made.poses()
    return Trial(seed, hand, scenario, _with_losses(poses, seed, hand, scenario), made.truth, length_mm)


def _imported(made: Simulated) -> Poses:
    """The recording as its file is read: faults of the tracker are found, repaired or left out."""
    with TemporaryDirectory() as folder:
        recording, table = Path(folder, "recording.parquet"), Path(folder, "poses.parquet")
        write_recording(recording, made)
        names = ("--layout", LAYOUT, "--subject", SUBJECT, "--hand", made.hand, "--task", made.task)
        files = ("--in", str(recording), "--out", str(table), "--repair-hemisphere")
        with redirect_stderr(StringIO()):  # it says what it finds
            assert import_recording.main([*files, *names]) == 0
        return read_poses(table, made.segments)


def true_length_mm(hand: Hand) -> float:
    """Length of a hand from the wrist's crease to the middle finger's soft tip, all bones in line."""
    middle = [i + 1 for i, joint in enumerate(JOINTS) if joint.startswith("middle_")]
    to_base_mm = hand.origin_mm[JOINTS.index("middle_cmc"), 0]
    soft_tip_mm = hand.soft_tip_mm[DIGITS.index("middle")]
    return float(CREASE_MM * hand.scale + to_base_mm + hand.length_mm[middle].sum() + soft_tip_mm)


def with_dip_range(angles_rad: Array, range_deg: float) -> Array:
    """Joint angles (T, J, 3) with the DIP joints' motion scaled, about the first frame, to a range."""
    scaled = angles_rad.copy()
    for joint in (JOINTS.index(f"{digit}_dip") for digit in FINGERS):
        moved = angles_rad[:, joint] - angles_rad[0, joint]
        scaled[:, joint] = angles_rad[0, joint] + moved * np.radians(range_deg) / np.ptp(moved[:, FLEXION])
    return scaled


def _with_cross_talk(made: Simulated, per_rad: float, seed: int) -> Simulated:
    """The middle phalanges' receivers tilted by the PIP joints, each about an axis of its own."""
    quaternion = made.quaternion.copy()
    axes = unit(generator(seed, "cross-talk", SUBJECT, made.hand).standard_normal((len(FINGERS), 3)))
    for axis, digit in zip(axes, FINGERS, strict=True):
        receiver = made.segments.index(f"{digit}_middle")
        bent = made.truth.angles_rad[:, JOINTS.index(f"{digit}_pip"), FLEXION]
        quaternion[:, receiver] = turned(quaternion[:, receiver], per_rad * bent[:, None] * axis)
    return replace(made, quaternion=quaternion)


def _with_losses(poses: Poses, seed: int, hand: str, scenario: Scenario) -> Poses:
    """The recording without what the scenario loses of it; lost poses are NaN."""
    n_frames = len(poses.frame)
    rng = generator(seed, "lost", SUBJECT, hand)
    lost = bursts(rng, n_frames, len(poses.segments), scenario.dropped)
    if scenario.half_absent:
        worn = [i for i, segment in enumerate(poses.segments) if segment != "hand"]
        lost[n_frames // 2 :, rng.choice(worn)] = True
    gone = lost[..., None]
    return replace(
        poses,
        position_mm=np.where(gone, np.nan, poses.position_mm),
        quaternion=np.where(gone, np.nan, poses.quaternion),
        valid=poses.valid & ~lost,
    )


def bursts(rng: np.random.Generator, n_frames: int, n_receivers: int, share: float) -> npt.NDArray[np.bool_]:
    """Which frames (T, S) are lost: each receiver loses that share on its own, in bursts of 0.25 s."""
    length = int(_BURST_S * RATE_HZ)
    n_bursts = -(-n_frames // length)
    lost = rng.random((n_bursts, n_receivers)) < share
    return np.repeat(lost, length, axis=0)[:n_frames]
