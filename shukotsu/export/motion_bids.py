"""Motion-BIDS: a dataset of all recordings, for neuroscience and human-computer interaction.

Every recording is written as two tracking systems: `tracksys-righthand`, the receivers, and
`tracksys-righthandskeleton` followed by the model's name, with joints, bones and joint angles. Positions are
in metres, joint angles in degrees. Recordings must not be added to a dataset by several processes at once.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from shukotsu.arrays import Array
from shukotsu.errors import InputError
from shukotsu.export import exported_motion
from shukotsu.export.delimited_text import write_rows
from shukotsu.export.exported_motion import ALONE_HZ, BONE_FRAME, RECEIVER_TIP, SKIN_TIP
from shukotsu.export.tidy_csv import bone_angles_deg
from shukotsu.hand.posing import PosedRecording
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.study.config_files import export_constants
from shukotsu.tables import limits
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.text_files import read_text
from shukotsu.tables.whole_files import write_text

DESCRIPTION, PARTICIPANTS = "dataset_description.json", "participants.tsv"
BEFORE_DESCRIPTION = ("README", PARTICIPANTS, "participants.json")
"""Files of a dataset that are written before DESCRIPTION."""
EXTRA_KEY = "Shukotsu"
"""Key in motion.json for facts that have no key in BIDS."""
_WORDS = export_constants()["bids"]
_UNITS = {"_mm": {"Units": "mm"}}
_NAME = {"name": {"Description": "The subject's name, from which participant_id is derived."}}


class MotionChannel(NamedTuple):
    """A column of motion.tsv: values (T,), NaN or null in gaps, and its row of channels.tsv.

    unmeasured : why no frame has a value. Such a channel is kept, without a data quality (status n/a), so
    that a recording has the same channels under every model.
    """

    values: pa.Array
    name: str
    component: str
    type: str
    tracked_point: str
    units: str
    description: str
    unmeasured: str = ""

    def row(self, rate_hz: str) -> dict[str, str]:
        """Return the column's row of channels.tsv."""
        frames = {"POS": "transmitter", "ORNT": "transmitter", "JNTANG": "parent_bone"}
        names = ("name", "component", "type", "tracked_point", "units")
        texts = {name: getattr(self, name) for name in names}
        placed = {"placement": self.tracked_point, "reference_frame": frames.get(self.type, "n/a")}
        status = {"status": "good", "status_description": "n/a", "sampling_frequency": rate_hz}
        if self.unmeasured:
            status |= {"status": "n/a", "status_description": f"not measured: {self.unmeasured}"}
        return texts | placed | {"description": self.description} | status


def label(name: str) -> str:
    """Return a name as a BIDS label of ASCII letters and digits; different names have different labels."""
    short = {"Q": "Q", "_": "u", "-": "d", " ": "s", ".": "p"}
    return re.sub(r"[^A-PR-Za-z0-9]", lambda odd: "Q" + short.get(odd[0], f"x{ord(odd[0]):x}x"), name)


def recording_path(name: RecordingName, model: str = "") -> str:
    """Return the path of a tracking system's files without their ending.

    A trial that is a number becomes the entity `run`, any other trial `acq`.
    """
    who = [f"sub-{label(name.subject)}", *([f"ses-{label(name.session)}"] if name.session else [])]
    system = f"{label(name.hand)}hand" + (f"skeleton{label(model)}" if model else "")
    numbered = re.fullmatch(r"[0-9]+", name.trial)
    trial = f"_run-{name.trial}" if numbered else f"_acq-{label(name.trial)}" if name.trial else ""
    return f"{'/'.join(who)}/motion/{'_'.join(who)}_task-{label(name.task)}_tracksys-{system}{trial}"


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Add a recording to a dataset, or replace it there; return sentences on what the files lack.

    path : the dataset's description. Raises InputError if there is no frame, if several frames have no known
    rate, or if the folder is not a dataset.
    """
    if not len(motion.frame):
        raise InputError(f"{path}: Motion-BIDS needs a recording with at least one frame; widen --frames")
    exported_motion.require_rate(motion, path, "BIDS")
    motion, unseen = exported_motion.with_seen_receivers(motion)
    add_participant(path.parent, motion.origin.recording.subject, motion.origin.licence)
    all_facts = exported_motion.facts(motion, "m", "")
    receiver_facts = {key: value for key, value in all_facts.items() if key not in ("model", "bone_frame")}
    receiver_facts["inputs_sha256"] = {
        name: sha for name, sha in motion.origin.inputs.items() if name.rpartition("/")[2] == "poses.parquet"
    }  # receivers do not depend on the model
    _write_system(path.parent, motion, "", receiver_facts, _receiver_channels)
    _write_system(path.parent, motion, motion.origin.model, all_facts, _skeleton_channels)
    if np.isfinite(motion.rate_hz):
        return unseen
    return (*unseen, f"a sampling frequency, which one frame does not have; {ALONE_HZ:g} Hz is stated")


def _write_system(
    folder: Path,
    motion: PosedRecording,
    model: str,
    more_facts: Mapping[str, Any],
    channels_of: Callable[[PosedRecording], Iterable[MotionChannel]],
) -> None:
    """Write the four files of a tracking system, motion.tsv last; model : name, empty for the receivers."""
    timed = motion.time_s[np.isfinite(motion.time_s)]
    name, rates = motion.origin.recording, sampling_rates(motion.rate_hz, motion.time_s)

    def channels(part: PosedRecording) -> list[MotionChannel]:
        return [*_clock_channels(part, timed), *channels_of(part)]

    first = channels(motion.take(slice(0, 1)))
    types = [channel.type for channel in first]
    points = list(motion.names if model else motion.receivers.segments)
    what = f"Skeleton from the model {model}" if model else "Receivers"
    stem = recording_path(name, model)
    motion_json = {
        "TaskName": name.task,
        "TaskDescription": f"Task {name.task}, {name.hand} hand. {what}.",
        **rates,
        "TrackingSystemName": stem.split("_tracksys-")[1].split("_")[0],
        "SoftwareVersions": f"{PROGRAM} {VERSION}",
        **dict.fromkeys(_WORDS["unknown"], "n/a"),
        "MissingValues": "n/a",
        "TrackedPointsCount": len(points),
        "MotionChannelCount": len(types),
        **{f"{kind}ChannelCount": types.count(kind) for kind in _WORDS["channel_types"]},
        EXTRA_KEY: {
            "FrameChannel": "frame",
            "TimeChannels": dict.fromkeys(points, "time") if len(timed) else {},
            **more_facts,
        },
    }
    rate = f"{rates['SamplingFrequency']:.6f}".rstrip("0").rstrip(".") if len(rates) > 1 else "n/a"
    rows = [channel.row(rate) for channel in first]
    turned = f"bone to this frame. A bone's own frame: {BONE_FRAME}" if model else "receiver to this frame"
    level = {"SpatialAxes": "n/a", "RotationRule": "n/a", "RotationOrder": "n/a"}
    posed = {"RotationRule": "right-hand", "Description": _WORDS["poses"].format(turned=turned)}
    levels = {"transmitter": level | posed}
    if "JNTANG" in types:
        levels["parent_bone"] = level | {"Description": _WORDS["joint_angles"]}
    frames = {"Description": "Reference frame of positions and orientations.", "Levels": levels}
    write_text(folder / f"{stem}_channels.tsv", tsv_text([list(rows[0]), *(row.values() for row in rows)]))
    write_text(folder / f"{stem}_channels.json", json_text({"reference_frame": frames}))
    write_text(folder / f"{stem}_motion.json", json_text(motion_json))

    def tables() -> Iterable[pa.Table]:
        for part in exported_motion.blocks(motion):
            texts = [pc.cast(channel.values, pa.string()).fill_null("n/a") for channel in channels(part)]
            yield pa.table(texts, [str(number) for number in range(len(texts))])

    write_rows(folder / f"{stem}_motion.tsv", "", tables(), "\t")


def sampling_rates(rate_hz: float, time_s: Array) -> dict[str, float]:
    """Return SamplingFrequency and, if the rate is known, the effective frequency and the duration.

    time_s : (T,), NaN if unknown. A single frame has no rate; its SamplingFrequency is ALONE_HZ.
    """
    if not np.isfinite(rate_hz):  # the validator rejects n/a
        return {"SamplingFrequency": ALONE_HZ}
    rate_hz, timed = round(rate_hz, 6), time_s[np.isfinite(time_s)]
    span_s = float(timed[-1] - timed[0]) if len(timed) else 0.0
    return {
        "SamplingFrequency": rate_hz,
        "SamplingFrequencyEffective": round((len(timed) - 1) / span_s, 6) if span_s > 0 else rate_hz,
        "RecordingDuration": round((span_s if span_s > 0 else (len(time_s) - 1) / rate_hz) + 1 / rate_hz, 6),
    }


def _clock_channels(motion: PosedRecording, timed: Array) -> Iterable[MotionChannel]:
    """Yield the channels of frame number, latency (time since the recording's first) and device time."""
    frame = pa.array(motion.frame)
    yield MotionChannel(frame, "frame", "n/a", "MISC", "n/a", "n/a", "frame number of the tracker")
    if len(timed):
        latency = [f"{t - timed[0]:.6f}" if np.isfinite(t) else None for t in motion.time_s]
        since = "time since the first sample"
        yield MotionChannel(pa.array(latency, pa.string()), "latency", "n/a", "LATENCY", "n/a", "s", since)
        device = pa.array(motion.time_s, from_pandas=True)
        yield MotionChannel(device, "time", "n/a", "MISC", "n/a", "s", "time of the tracker")


def _receiver_channels(motion: PosedRecording) -> Iterable[MotionChannel]:
    """Yield the channels of every receiver's pose; the tracked points are the segments that carry them."""
    receivers = motion.receivers
    for index, segment in enumerate(receivers.segments):
        yield from _numbers(segment, "POS", "receiver", receivers.position_mm[:, index])
        yield from _numbers(segment, "ORNT", "receiver", receivers.quaternion[:, index])


def _skeleton_channels(motion: PosedRecording) -> Iterable[MotionChannel]:
    """Yield the channels of joints' positions, bones' rotations, and angles of joints of known anatomy."""
    for index, joint in enumerate(motion.joints):
        ends = {SKIN_TIP: "end of the digit, including the skin", RECEIVER_TIP: "distal receiver's origin"}
        end = next((kind for name, kind in ends.items() if joint.name.endswith(name)), "end of the last bone")
        yield from _numbers(joint.name, "POS", end if joint.tip else "joint", motion.position_mm[:, index])
        if not joint.tip:
            yield from _numbers(joint.name, "ORNT", "bone", motion.quaternion[:, index])
    for name, angles_deg in bone_angles_deg(motion).items():
        signed = "joint, with the signs stated in reference_frame"
        yield from _numbers(name, "JNTANG", signed, angles_deg, motion.joints[motion.index(name)].assumed)


def _numbers(point: str, kind: str, what: str, values: Array, why_not: str = "") -> Iterable[MotionChannel]:
    """Yield the channels of positions (T, 3), mm, rotations (T, 4) or angles (T, 3), deg; NaN in gaps.

    why_not : why no frame has values.
    """
    unit, text, names, digits = {
        "POS": ("m", "position of the {}, {}", ("pos_x", "pos_y", "pos_z"), 12),
        "ORNT": ("n/a", "{} to transmitter frame, {}", ("quat_w", "quat_x", "quat_y", "quat_z"), 12),
        "JNTANG": ("deg", "{1} of the {0}", ("flexion", "abduction", "rotation"), 6),
    }[kind]
    scaled = (values / 1000 if kind == "POS" else values).round(digits) + 0.0  # + 0.0: no minus zero
    for name, column in zip(names, scaled.T, strict=True):
        part = {"POS": name[-1:], "ORNT": name}.get(kind, "n/a")
        numbers = pa.array(column, from_pandas=True)
        described = text.format(what, name if kind == "JNTANG" else part)
        yield MotionChannel(numbers, f"{point}_{name}", part, kind, point, unit, described, why_not)


def tsv_text(rows: Iterable[Iterable[object]]) -> str:
    """Format rows as the text of a TSV file, without tabs or line breaks in cells, and n/a for empty ones."""
    cell = lambda value: "n/a" if value is None else " ".join(str(value).split()) or "n/a"  # noqa: E731
    return "".join("\t".join(map(cell, row)) + "\n" for row in rows)


def json_text(content: Mapping[str, Any]) -> str:
    """Format a JSON object as the text of a sidecar file."""
    return json.dumps(content, ensure_ascii=False, indent=2) + "\n"


def write_dataset_files(
    folder: Path, name: str, participants: Mapping[str, Mapping[str, Any]], licence: str = ""
) -> None:
    """Write or replace the files that describe a whole dataset.

    participants : further columns of participants.tsv by subject; None if unknown. Raises InputError if the
    folder is a file, or contains files but no dataset.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; expected a folder for the dataset")
    others = [path for path in folder.glob("[!.]*") if path.name not in BEFORE_DESCRIPTION]
    if others and not (folder / DESCRIPTION).is_file():
        raise InputError(f"{folder}: contains files but no {DESCRIPTION}; expected a new folder or a dataset")
    columns = dict.fromkeys(column for values in participants.values() for column in values)
    more = [column for column in columns if column not in ("participant_id", "name")]
    rows = [
        [f"sub-{label(subject)}", subject, *(values.get(column) for column in more)]
        for subject, values in participants.items()
    ]
    sheet = "as in the study's participants sheet."
    described = _NAME | {n: {"Description": f"{n} {sheet}"} | _UNITS.get(n[-3:], {}) for n in more}
    write_text(folder / "README", _WORDS["readme"].format(program=PROGRAM, key=EXTRA_KEY))
    write_text(folder / PARTICIPANTS, tsv_text([["participant_id", "name", *more], *sorted(rows)]))
    write_text(folder / "participants.json", json_text(described))
    description = {"Name": name, "BIDSVersion": "1.10.0", "DatasetType": "raw"}
    generated = [{"Name": PROGRAM, "Version": VERSION}]
    licensed = {"License": licence} if licence else {}
    write_text(folder / DESCRIPTION, json_text(description | licensed | {"GeneratedBy": generated}))


def add_participant(folder: Path, subject: str, licence: str = "") -> None:
    """Add a subject to a dataset if it is missing; a folder without a dataset gets one with this subject."""
    path = folder / PARTICIPANTS
    if not (folder / DESCRIPTION).is_file():
        write_dataset_files(folder, folder.resolve().name, {subject: {}}, licence)
        return
    text = read_text(path, "a dataset's participants", limits.SHEET_BYTES) if path.exists() else ""
    header, *rows = csv.reader(io.StringIO(text), delimiter="\t", quoting=csv.QUOTE_NONE) if text else [[]]
    if header[:2] != ["participant_id", "name"]:
        raise InputError(f"{path}: expected the columns participant_id and name first; found {header[:2]}")
    if f"sub-{label(subject)}" not in [row[0] for row in rows]:
        added = [f"sub-{label(subject)}", subject, *["n/a"] * (len(header) - 2)]
        write_text(path, tsv_text([header, *sorted([*rows, added])]))
