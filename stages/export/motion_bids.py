"""Motion-BIDS: a dataset that gathers recordings, for neuroscience and human-computer interaction.

Of every recording two tracking systems are written, as BIDS calls what shares a clock: `tracksys-righthand`,
the receivers, as `stages.capture export-bids` names them, and `tracksys-righthandskeleton` with the model's
name, the hand's joints, bones and joint angles. Names become labels by `schemas.bids.labels`; in full
they stand in participants.tsv and motion.json.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from schemas import PROGRAM, VERSION
from schemas.bids.channels import OWN_KEY, channel_counts
from schemas.bids.dataset_files import (
    DESCRIPTION,
    check_folder,
    description_json,
    json_text,
    read_rows,
    tsv_cell,
    tsv_text,
    write_motion,
)
from schemas.bids.labels import label, motion_folder, recording_stem, tracking_system
from schemas.errors import InputError
from schemas.files import write_text
from stages.export.axes import Target
from stages.export.bids_channels import (
    System,
    receiver_system,
    reference_frames,
    rows,
    skeleton_system,
)
from stages.export.file_facts import facts
from stages.export.motion import Origin, SkeletonMotion, with_seen_receivers

ALONE_HZ = 60.0
"""SamplingFrequency of one frame, whose rate nobody knows: the validator takes no n/a there."""

_README = f"""Hand motion from magnetic receivers, exported by {PROGRAM}.

Every recording of one hand has two tracking systems in sub-*/motion. "righthand" or "lefthand" are the
receivers as they were recorded. The same with "skeleton" and the name of a skeleton model are that person's
joints and bones, computed from the receivers: positions of joints, rotations of the bones that start there,
and joint angles where the anatomy is known. Both have the same frames and the same clock.

Positions are in metres and orientations are unit quaternions, to the frame of the transmitter, which did not
move; joint angles are in degrees. n/a stands where there was no pose; nothing was filled or smoothed unless
"notes" in motion.json says so. Names that BIDS does not allow in a file name are written out in full under
"{OWN_KEY}" in each motion.json, and subjects' names in participants.tsv: in a label, Q starts the stand-in of
a character that it may not hold (Qs a blank, Qd a hyphen, Qu an underscore, Qp a point, QQ the letter Q, Qx
and x around any other character's code point in hexadecimal).
"""

_UNKNOWN = (
    *("Instructions", "Manufacturer", "ManufacturersModelName", "DeviceSerialNumber"),
    *("InstitutionName", "InstitutionAddress", "InstitutionalDepartmentName", "SubjectArtefactDescription"),
)
"""Keys of motion.json that BIDS recommends and no table tells."""


def write(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    """Add a recording to the dataset in the folder of `path`, its dataset_description.json.

    What was written of the recording before is replaced, everything else stays; the dataset's own files are
    made where they are absent. Recordings of one dataset must not be added at the same time. Give what the
    files do not hold. Raises InputError where there is no frame, no rate is known for more than one, or the
    folder is no dataset.
    """
    folder, origin = path.parent, motion.origin
    if not len(motion.frame):
        raise InputError(f"{path}: Motion-BIDS holds no recording without a frame; widen --frames")
    if len(motion.frame) > 1 and not np.isfinite(motion.rate_hz):
        raise InputError(
            f"{path}: the recording has no device time, and BIDS needs a rate; say it with --rate-hz"
        )
    motion, unseen = with_seen_receivers(motion)
    check_folder(folder)
    if not (folder / DESCRIPTION).exists():
        write_dataset_files(folder, folder.resolve().name, {}, origin.licence)
    _add_participant(folder / "participants.tsv", origin.subject)
    hand = tracking_system(origin.hand)
    _write_system(motion, target, folder, hand, receiver_system)
    skeleton = f"{hand}skeleton{label(origin.model)}"
    _write_system(motion, target, folder, skeleton, skeleton_system)
    if np.isfinite(motion.rate_hz):
        return unseen
    return (*unseen, f"a sampling frequency, which one frame does not have; {ALONE_HZ:g} Hz stands for it")


def write_dataset_files(
    folder: Path, name: str, participants: Mapping[str, Mapping[str, Any]], licence: str = ""
) -> None:
    """Write or replace the files that describe a whole dataset: name, licence, README, participants.

    participants : subject -> more columns of participants.tsv, None where not known; all subjects have the
    same ones. The order of subjects does not matter. Raises InputError where the folder is no dataset.
    """
    check_folder(folder)
    write_text(folder / "README", _README)
    names = dict.fromkeys(column for known in participants.values() for column in known)
    columns = [column for column in names if column not in ("participant_id", "name")]
    table = [
        [f"sub-{label(subject)}", tsv_cell(subject), *(tsv_cell(known.get(column)) for column in columns)]
        for subject, known in participants.items()
    ]
    _write_participants(folder / "participants.tsv", ["participant_id", "name", *columns], table)
    columns_json = {"name": {"Description": "The subject's name, of which participant_id is made."}}
    columns_json |= {column: _described(column) for column in columns}
    write_text(folder / "participants.json", json_text(columns_json))
    write_text(folder / DESCRIPTION, json_text(description_json(name, licence)))  # last: then all is there


def _described(column: str) -> dict[str, str]:
    described = {"Description": f"{column} as the study's participants sheet has it."}
    return described | ({"Units": "mm"} if column.endswith("_mm") else {})


def _add_participant(path: Path, subject: str) -> None:
    header, table = read_rows(path) if path.exists() else (["participant_id", "name"], [])
    if "participant_id" not in header:
        raise InputError(f"{path}: column participant_id is missing; found {', '.join(header)}")
    cells = {"participant_id": f"sub-{label(subject)}", "name": tsv_cell(subject)}
    if cells["participant_id"] not in [row[header.index("participant_id")] for row in table]:
        _write_participants(path, header, [*table, [cells.get(column, "n/a") for column in header]])


def _write_participants(path: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> None:
    place = list(header).index("participant_id")
    write_text(path, tsv_text([header, *sorted(table, key=lambda row: row[place])]))


def recording_path(folder: Path, origin: Origin, system: str) -> Path:
    """Path of a motion.tsv in the dataset; system : its tracksys label."""
    hand = tracking_system(origin.hand)
    stem = recording_stem(origin.recording).replace(f"_tracksys-{hand}", f"_tracksys-{system}", 1)
    return folder / motion_folder(origin.recording) / f"{stem}_motion.tsv"


def _write_system(
    motion: SkeletonMotion,
    target: Target,
    folder: Path,
    name: str,
    system_of: Callable[[SkeletonMotion, float], System],
) -> None:
    path = recording_path(folder, motion.origin, name)
    known = motion.time_s[np.isfinite(motion.time_s)]
    start_s = float(known[0]) if len(known) else float("nan")
    system = system_of(motion.take(slice(0, 1)), start_s)

    def beside(ending: str) -> Path:
        return path.with_name(path.name.removesuffix("_motion.tsv") + ending)

    rate = f"{motion.rate_hz:.6f}".rstrip("0").rstrip(".") if np.isfinite(motion.rate_hz) else "n/a"
    write_text(beside("_channels.tsv"), tsv_text(rows(system, rate)))
    write_text(beside("_channels.json"), json_text(reference_frames(system)))
    write_text(beside("_motion.json"), json_text(_motion_json(motion, target, name, system)))
    blocks = ([column.text for column in system_of(block, start_s).columns] for block in motion.blocks())
    write_motion(path, blocks)


def _motion_json(motion: SkeletonMotion, target: Target, name: str, system: System) -> dict[str, Any]:
    origin = motion.origin
    what = f"Skeleton by the model {origin.model}" if system.bones else "Receivers"
    return {
        "TaskName": origin.task,
        "TaskDescription": f"Task {origin.task}, {origin.hand} hand. {what}.",
        **_rates(motion),
        "TrackingSystemName": name,
        "SoftwareVersions": f"{PROGRAM} {VERSION}",
        **dict.fromkeys(_UNKNOWN, "n/a"),
        "MissingValues": "n/a",
        "TrackedPointsCount": len(system.points),
        **channel_counts(system.columns),
        OWN_KEY: _own_json(motion, target, system),
    }


def _rates(motion: SkeletonMotion) -> dict[str, Any]:
    """SamplingFrequency and what is told by the times; of one frame whose rate is not known ALONE_HZ."""
    if not np.isfinite(motion.rate_hz):
        return {"SamplingFrequency": ALONE_HZ}
    rate_hz = round(motion.rate_hz, 6)
    known = motion.time_s[np.isfinite(motion.time_s)]
    span_s = float(known[-1] - known[0]) if len(known) else 0.0
    effective_hz = round((len(known) - 1) / span_s, 6) if span_s > 0 else rate_hz
    duration_s = round((span_s if span_s > 0 else (len(motion.frame) - 1) / rate_hz) + 1 / rate_hz, 6)
    return {
        "SamplingFrequency": rate_hz,
        "SamplingFrequencyEffective": effective_hz,
        "RecordingDuration": duration_s,
    }


def _own_json(motion: SkeletonMotion, target: Target, system: System) -> dict[str, Any]:
    """What BIDS has no key for; `stages.capture import` reads frame numbers and times back by it.

    Receivers are the same by any model, and nothing of a model is said of them.
    """
    known = facts(motion, target)
    if not system.bones:
        known = {key: value for key, value in known.items() if key not in ("model", "bone_frame")}
        known["inputs_sha256"] = {name: sha for name, sha in motion.origin.inputs.items() if _is_poses(name)}
    times = dict.fromkeys(system.points, "time") if system.timed else {}
    return {"FrameChannel": "frame", "TimeChannels": times, **known}


def _is_poses(name: str) -> bool:
    return name.rpartition("/")[2] == "poses.parquet"
