"""Motion-BIDS: a dataset that gathers recordings, for neuroscience and human-computer interaction.

Of every recording two tracking systems are written, as BIDS calls what shares a clock: `tracksys-righthand`,
the receivers, as `stages.capture export-bids` names them, and `tracksys-righthandskeleton` with the model's
name, the hand's joints, bones and joint angles. Names become labels by `stages.capture.bids.labels`; in full
they stand in participants.tsv and motion.json.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from schemas import PROGRAM, VERSION
from schemas.errors import InputError
from schemas.files import replacing, write_text
from schemas.poses import RecordingName
from stages.capture.bids.labels import label, recording_stem, tracking_system
from stages.capture.bids.sidecars import OWN_KEY, read_rows
from stages.export.bids_channels import (
    System,
    counts,
    receiver_system,
    reference_frames,
    rows,
    skeleton_system,
)
from stages.export.formats import Target
from stages.export.frames import blocks
from stages.export.motion import Origin, SkeletonMotion
from stages.export.note import facts
from stages.export.receivers import with_seen_receivers

BIDS_VERSION = "1.10.0"
DESCRIPTION = "dataset_description.json"
"""The one file of a dataset that is there before its recordings."""

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
    _check_folder(folder)
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
    _check_folder(folder)
    description = {
        "Name": name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        **({"License": licence} if licence else {}),
        "GeneratedBy": [{"Name": PROGRAM, "Version": VERSION}],
    }
    write_text(folder / DESCRIPTION, _json(description))
    write_text(folder / "README", _README)
    told_columns = dict.fromkeys(column for known in participants.values() for column in known)
    columns = [column for column in told_columns if column not in ("participant_id", "name")]
    table = [
        [f"sub-{label(subject)}", _cell(subject), *(_cell(known.get(column)) for column in columns)]
        for subject, known in participants.items()
    ]
    _write_participants(folder / "participants.tsv", ["participant_id", "name", *columns], table)
    told = {"name": {"Description": "The subject's name, of which participant_id is made."}}
    told |= {column: _described(column) for column in columns}
    write_text(folder / "participants.json", _json(told))


def _described(column: str) -> dict[str, str]:
    told = {"Description": f"{column} as the study's participants sheet has it."}
    return told | ({"Units": "mm"} if column.endswith("_mm") else {})


def _add_participant(path: Path, subject: str) -> None:
    header, table = read_rows(path) if path.exists() else (["participant_id", "name"], [])
    if "participant_id" not in header:
        raise InputError(f"{path}: column participant_id is missing; found {', '.join(header)}")
    cells = {"participant_id": f"sub-{label(subject)}", "name": _cell(subject)}
    if cells["participant_id"] not in [row[header.index("participant_id")] for row in table]:
        _write_participants(path, header, [*table, [cells.get(column, "n/a") for column in header]])


def _write_participants(path: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> None:
    place = list(header).index("participant_id")
    write_text(path, _tsv([header, *sorted(table, key=lambda row: row[place])]))


def _cell(value: Any) -> str:
    """A cell of a table: no tab, no line break, n/a for nothing."""
    return "n/a" if value is None else " ".join(str(value).split()) or "n/a"


def _check_folder(folder: Path) -> None:
    if folder.is_dir() and any(folder.iterdir()) and not (folder / DESCRIPTION).is_file():
        raise InputError(
            f"{folder}: holds files but no {DESCRIPTION}; expected a new folder or a BIDS dataset"
        )


def recording_path(folder: Path, origin: Origin, system: str) -> Path:
    """Path of a motion.tsv in the dataset; system : its tracksys label."""
    name = RecordingName(origin.subject, origin.hand, origin.task, origin.trial)
    hand = tracking_system(origin.hand)
    stem = recording_stem(name).replace(f"_tracksys-{hand}", f"_tracksys-{system}", 1)
    return folder / f"sub-{label(origin.subject)}" / "motion" / f"{stem}_motion.tsv"


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
    write_text(beside("_channels.tsv"), _tsv(rows(system, rate)))
    write_text(beside("_channels.json"), _json(reference_frames(system)))
    write_text(beside("_motion.json"), _json(_motion_json(motion, target, name, system)))
    options = pa_csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    with replacing(path) as temporary, temporary.open("wb") as stream:
        for block in blocks(motion):
            texts = [column.text.fill_null("n/a") for column in system_of(block, start_s).columns]
            table = pa.table(texts, names=[str(index) for index in range(len(texts))])
            pa_csv.write_csv(table, stream, options)


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
        **counts(system.columns),
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
    told = facts(motion, target)
    if not system.bones:
        told = {key: value for key, value in told.items() if key not in ("model", "bone_frame")}
        told["inputs_sha256"] = {name: sha for name, sha in motion.origin.inputs.items() if _is_poses(name)}
    times = dict.fromkeys(system.points, "time") if system.timed else {}
    return {"FrameChannel": "frame", "TimeChannels": times, **told}


def _is_poses(name: str) -> bool:
    return name.rpartition("/")[2] == "poses.parquet"


def _tsv(records: Sequence[Sequence[str]]) -> str:
    return "".join("\t".join(record) + "\n" for record in records)


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, ensure_ascii=False, indent=2) + "\n"
