"""Motion-BIDS: a dataset that gathers recordings, for neuroscience and human-computer interaction.

Of every recording two tracking systems are written, as BIDS calls what shares a clock: `tracksys-righthand`,
the receivers, as `shukotsu export-bids` writes them alone, and `tracksys-righthandskeleton` with the model's
name, the hand's joints, bones and joint angles. Receivers keep every digit that their table has; of joints,
which are computed, nanometres and nine decimals. `shukotsu import` reads both back.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.motion_bids.dataset_files import add_participants
from shukotsu.motion_bids.decimals import text_of
from shukotsu.motion_bids.motion_files import (
    ALONE_HZ,
    Column,
    TrackingSystem,
    frame_column,
    place_columns,
    receiver_columns,
    sampling_rates,
    time_columns,
    turn_columns,
    write_tracking_system,
)
from shukotsu.skeleton.posing import SkeletonJoint
from shukotsu.stages.export.axes import Target
from shukotsu.stages.export.file_facts import BONE_FRAME, facts
from shukotsu.stages.export.motion import RECEIVER_TIP, SKIN_TIP, SkeletonMotion, with_seen_receivers
from shukotsu.stages.export.tidy_csv import bone_angles_deg

ANGLES = ("flexion", "abduction", "rotation")


def write(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    """Add a recording to the dataset in the folder of `path`, its dataset_description.json.

    What was written of the recording before is replaced, everything else stays; the dataset's own files are
    made where they are absent. Recordings of one dataset must not be added at the same time. Give what the
    files do not hold. Raises InputError where there is no frame, no rate is known for more than one, or the
    folder is no dataset.
    """
    if not len(motion.frame):
        raise InputError(f"{path}: Motion-BIDS holds no recording without a frame; widen --frames")
    if len(motion.frame) > 1 and not np.isfinite(motion.rate_hz):
        raise InputError(
            f"{path}: the recording has no device time, and BIDS needs a rate; say it with --rate-hz"
        )
    motion, unseen = with_seen_receivers(motion)
    add_participants(path.parent, [motion.origin.subject], motion.origin.licence)
    known = facts(motion, target)
    of_receivers = {key: value for key, value in known.items() if key not in ("model", "bone_frame")}
    of_receivers["inputs_sha256"] = {
        name: sha for name, sha in motion.origin.inputs.items() if name.rpartition("/")[2] == "poses.parquet"
    }  # receivers are the same by any model
    name, points = motion.origin.recording, motion.receivers.segments
    _write(path.parent, motion, TrackingSystem(name, "", points, of_receivers), _receivers)
    skeleton = TrackingSystem(name, motion.origin.model, motion.names, known, BONE_FRAME)
    _write(path.parent, motion, skeleton, _skeleton)
    if np.isfinite(motion.rate_hz):
        return unseen
    return (*unseen, f"a sampling frequency, which one frame does not have; {ALONE_HZ:g} Hz stands for it")


def _write(
    folder: Path,
    motion: SkeletonMotion,
    system: TrackingSystem,
    columns_of: Callable[[SkeletonMotion], list[Column]],
) -> None:
    known = motion.time_s[np.isfinite(motion.time_s)]
    start_s = float(known[0]) if len(known) else float("nan")

    def columns(part: SkeletonMotion) -> list[Column]:
        return [frame_column(part.frame), *time_columns(part.time_s, start_s), *columns_of(part)]

    rates, blocks = sampling_rates(motion.rate_hz, motion.time_s), map(columns, motion.blocks())
    write_tracking_system(folder, system, rates, columns(motion.take(slice(0, 1))), blocks)


def _receivers(motion: SkeletonMotion) -> list[Column]:
    """Every receiver's pose, tracked points being the segments that carry them; n/a where not valid."""
    own = motion.receivers
    return [
        column
        for index, segment in enumerate(own.segments)
        for column in receiver_columns(segment, own.position_mm[:, index], own.quaternion[:, index])
    ]


def _skeleton(motion: SkeletonMotion) -> list[Column]:
    """Every joint's position, the rotation of the bone that starts there, and the angles of known anatomy."""
    columns: list[Column] = []
    position, turn = (motion.position_mm / 1000).round(9), motion.quaternion.round(9)
    for index, joint in enumerate(motion.joints):
        columns += place_columns(joint.name, _kind(joint), position[:, index])
        if not joint.tip:
            columns += turn_columns(joint.name, "bone", turn[:, index])
    names, angles = bone_angles_deg(motion)
    for index, own in enumerate(names):
        for name, degrees in zip(ANGLES, angles[:, index].T.round(6), strict=True):
            what, text = f"{name} of the joint, signed as reference_frame says", text_of(degrees + 0.0)
            columns.append(Column(text, f"{own}_{name}", "n/a", "JNTANG", own, "deg", what))
    return columns


def _kind(joint: SkeletonJoint) -> str:
    """Describe the kind of a point of the skeleton in words."""
    if not joint.tip:
        return "joint"
    if joint.name.endswith(SKIN_TIP):
        return "end of the digit, skin and all"
    if joint.name.endswith(RECEIVER_TIP):
        return "distal receiver's origin, taken for the tip"
    return "end of the last bone"
