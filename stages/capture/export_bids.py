"""Command line: poses tables -> a Motion-BIDS dataset, new or one to add to."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import InputError
from stages import command_line

if TYPE_CHECKING:
    from schemas.poses import RecordingName
    from stages.capture.motion_columns import Timing

_ENDINGS = ("_motion.tsv", "_motion.json", "_channels.tsv", "_channels.json")

_README = """Motion recordings of magnetic receivers on the hand, exported by Shukotsu.

Every file of sub-*/motion is one recording of one hand: the tracksys label says which. Positions are in
metres and orientations are unit quaternions (receiver to transmitter frame); n/a stands where the tracker
gave no pose. Names that BIDS does not allow in a file name are written out in full under "Shukotsu" in
each motion.json, and subjects' names in participants.tsv.
"""


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu export-bids",
        "Write poses tables into a Motion-BIDS dataset; what else is in it stays as it is.",
        "shukotsu export-bids --poses poses.parquet --out dataset",
        records_failure=False,
    )
    parser.add_argument("--poses", type=Path, nargs="+", required=True, help="poses tables, one a recording")
    parser.add_argument("--out", type=Path, required=True, help="the dataset's folder, new or a BIDS dataset")
    parser.add_argument(
        "--rate-hz", type=_positive, help="nominal frames a second; computed from the times if absent"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace recordings that are there already")
    return parser


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < 1e9:
        raise argparse.ArgumentTypeError(f"is {text!r}; expected frames a second above 0")
    return number


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return command_line.run(build_parser().parse_args(argv), export)


@dataclass(frozen=True)
class _Target:
    """One recording to write: whose it is, and the path of its files without their endings."""

    poses: Path
    name: RecordingName
    stem: Path

    def file(self, ending: str) -> Path:
        """The recording's file of that ending."""
        return self.stem.with_name(self.stem.name + ending)


def export(arguments: argparse.Namespace) -> None:
    """Write the recordings of poses tables into the dataset in a folder, all tables checked before.

    Files of other recordings stay, and so do the dataset's own where it has them. Raises InputError where the
    folder holds something else, a recording is there already, or a table is none or has no times and no rate
    is given.
    """
    from schemas.bids.dataset_files import check_folder
    from stages.capture.motion_columns import read_grid, timing

    folder: Path = arguments.out
    check_folder(folder)
    targets = _targets(arguments.poses, folder)
    timings = []
    for target in targets:
        existing = [target.file(ending) for ending in _ENDINGS if target.file(ending).exists()]
        if existing and not arguments.overwrite:
            raise InputError(f"{existing[0]}: is there already; give --overwrite to replace the recording")
        timings.append(timing(target.poses, read_grid(target.poses), arguments.rate_hz))
    _write_dataset_files(folder)
    _write_participants(folder / "participants.tsv", [target.name.subject for target in targets])
    for target, timed in zip(targets, timings, strict=True):
        _write_recording(target, timed)


def _targets(poses: Sequence[Path], folder: Path) -> list[_Target]:
    from schemas.bids.labels import motion_folder, recording_stem
    from schemas.poses import recording_name

    targets: dict[Path, _Target] = {}
    for path in poses:
        name = recording_name(path)
        if not (name.subject and name.task):
            raise InputError(f"{path}: names no subject or no task; BIDS needs both in a file's name")
        stem = folder / motion_folder(name) / recording_stem(name)
        if stem in targets:
            raise InputError(
                f"{path}: is of {name}, as {targets[stem].poses} is; give each recording its trial"
            )
        targets[stem] = _Target(path, name, stem)
    return list(targets.values())


def _write_dataset_files(folder: Path) -> None:
    from schemas.bids.dataset_files import DESCRIPTION, description_json, json_text
    from schemas.files import write_text

    if not (folder / DESCRIPTION).exists():
        write_text(folder / DESCRIPTION, json_text(description_json(folder.resolve().name)))
    if not any(folder.glob("README*")):
        write_text(folder / "README", _README)


def _write_participants(path: Path, subjects: Sequence[str]) -> None:
    """Add the subjects that the table does not have; its columns and rows stay as they are."""
    from schemas.bids.dataset_files import json_text, read_rows, tsv_cell, tsv_text
    from schemas.bids.labels import label
    from schemas.files import write_text

    header, rows = read_rows(path) if path.exists() else (["participant_id", "name"], [])
    if "participant_id" not in header:
        raise InputError(f"{path}: column participant_id is missing; found {', '.join(header)}")
    known = {row[header.index("participant_id")] for row in rows}
    fresh = [subject for subject in dict.fromkeys(subjects) if f"sub-{label(subject)}" not in known]
    for subject in fresh:
        cells = {"participant_id": f"sub-{label(subject)}", "name": tsv_cell(subject)}
        rows.append([cells.get(column, "n/a") for column in header])
    if fresh:
        write_text(path, tsv_text([header, *rows]))
    if not path.with_suffix(".json").exists() and "name" in header:
        content = {"name": {"Description": "The subject's name, of which participant_id is made."}}
        write_text(path.with_suffix(".json"), json_text(content))


def _write_recording(target: _Target, timed: Timing) -> None:
    from schemas.bids.channels import channels_json
    from schemas.bids.dataset_files import json_text, tsv_text, write_motion
    from schemas.files import file_sha256, write_text
    from stages.capture.motion_columns import motion_columns, motion_json, read_grid

    grid = read_grid(target.poses)
    columns = motion_columns(grid)
    inputs = {target.poses.name: file_sha256(target.poses)}
    rows = [column.row for column in columns]
    write_motion(target.file("_motion.tsv"), [[column.text for column in columns]])
    write_text(target.file("_motion.json"), json_text(motion_json(grid, columns, timed, inputs)))
    write_text(target.file("_channels.tsv"), tsv_text([list(rows[0]), *(list(row.values()) for row in rows)]))
    write_text(target.file("_channels.json"), json_text(channels_json()))
