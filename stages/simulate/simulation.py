"""The simulation from end to end: a subject's hand, its motion, and what a tracker makes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.forward import bone_poses, relaxed_angles
from shukotsu.stages.simulate.mounts import mounts_of
from shukotsu.stages.simulate.moving_skin import SkinLaw, displaced, on_skin, skin_of
from shukotsu.stages.simulate.random_hand import DIGITS, hand_of
from shukotsu.stages.simulate.randomness import generator
from shukotsu.stages.simulate.realism import PHASE_LAG, POLYNOMIAL, SATURATING, Realism
from shukotsu.stages.simulate.simulated_truth import Truth
from shukotsu.stages.simulate.skin_laws import phase_lag, polynomial, saturating
from shukotsu.stages.simulate.task_motion import RATE_HZ, TASK_FRAMES, Motion, move
from shukotsu.stages.simulate.tracker_errors import distorted, faulty, noisy

LAWS: Mapping[str, SkinLaw] = {SATURATING: saturating, POLYNOMIAL: polynomial, PHASE_LAG: phase_lag}

LAYOUT = "liberty16"
FIRST_FRAME = 1


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
    trial: str = "",
    change: Callable[[Motion], Motion] | None = None,
) -> Simulated:
    """Simulate one recording with 16 receivers, 17 with `forearm`, at 240 Hz.

    Anatomy depends on seed and subject, receivers' places and skin also on the hand, motion and noise also on
    the task. In another session the person moves anew, with receivers put on anew; in another trial noise and
    skin wander anew. Another n_frames than the task's own is the same script, faster or slower. change : of
    what the task makes the hand do. Raises InputError where an argument is not usable.
    """
    n_frames = _checked(hand, task, seed, n_frames)
    layout, in_session = read_layout(LAYOUT), [*filter(None, (session, trial))]
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
        of_hand = generator(seed, f"{realism.skin} skin", subject, hand)
        of_recording = generator(seed, "wander", subject, hand, task, *in_session)
        off = LAWS[realism.skin](motion.angles_rad - relaxed, skin, of_hand, of_recording)
        ridden = displaced(*on_skin(anatomy, mounts, motion, relaxed, bones, skin), *off)
    recorded = ridden
    if realism.field_distortion:
        recorded = distorted(*recorded, seed, realism.field_distortion)
    if realism.noise:
        rng = generator(seed, "noise", subject, hand, task, *in_session)
        recorded = noisy(*recorded, realism.noise, rng)
    truth = Truth.of(layout, anatomy, mounts, motion.angles_rad, bones, ridden, recorded, realism)
    if realism.faults:
        rng = generator(seed, "faults", subject, hand, task, *in_session)
        recorded = faulty(*recorded, realism.faults, rng)
    frame = np.arange(FIRST_FRAME, FIRST_FRAME + n_frames)
    return Simulated(subject, hand, task, frame, frame / RATE_HZ, segments, *recorded, truth, session)


def _checked(hand: str, task: str, seed: int, n_frames: int | None) -> int:
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
