"""Command line: poses tables -> a Motion-BIDS dataset, new or one to add to."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.errors import InputError
from stages import command_line

if TYPE_CHECKING:
    from schemas.poses import RecordingName
    from stages.capture.bids.recording import Column, Timing

BIDS_VERSION = "1.10.0"

_ENDINGS = ("_motion.tsv", "_motion.json", "_channels.tsv", "_channels.json")

_README = """Motion recordings of magnetic receivers on the hand, exported by Shukotsu.

Every file of sub-*/motion is one recording of one hand: the tracksys label says which. Positions are in
metres and orientations are unit quaternions (receiver to transmitter frame); n/a stands where the tracker
gave no pose. Names that BIDS does not allow in a file name are written out in full under "Shukotsu" in
each motion.json, and subjects' names in participants.tsv.
"""


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = argparse.ArgumentParser(
        prog="python -m stages.capture export-bids",
        description="Write poses tables into a Motion-BIDS dataset; what else is in it stays as it is.",
        epilog="example:\n  python -m stages.capture export-bids --poses poses.parquet --out dataset",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--poses", type=Path, nargs="+", required=True, help="poses tables, one a recording")
    parser.add_argument("--out", type=Path, required=True, help="the dataset's folder, new or a BIDS dataset")
    parser.add_argument(
        "--rate-hz", type=_positive, help="nominal frames a second; told from the times if absent"
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


def main(arguments: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    parsed = build_parser().parse_args(arguments)
    try:
        export(parsed.poses, parsed.out, parsed.rate_hz, overwrite=parsed.overwrite)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return command_line.EXIT_BAD_INPUT
    return 0


@dataclass(frozen=True)
class _Target:
    """One recording to write: whose it is, and the path of its files without their endings."""

    poses: Path
    name: RecordingName
    stem: Path

    def file(self, ending: str) -> Path:
        """The recording's file of that ending."""
        return self.stem.with_name(self.stem.name + ending)


def export(poses: Sequence[Path], folder: Path, rate_hz: float | None, *, overwrite: bool = False) -> None:
    """Write the recordings of poses tables into the dataset in `folder`, all tables checked before.

    Files of other recordings stay, and so do the dataset's own where it has them. Raises InputError where the
    folder holds something else, a recording is there already, or a table is none or has no times and no rate
    is given.
    """
    from stages.capture.bids.recording import read_grid, timing

    _check_folder(folder)
    targets = _targets(poses, folder)
    timings = []
    for target in targets:
        if not overwrite:
            _check_absent(target)
        timings.append(timing(target.poses, read_grid(target.poses), rate_hz))
    _write_dataset_files(folder)
    _write_participants(folder / "participants.tsv", [target.name.subject for target in targets])
    for target, timed in zip(targets, timings, strict=True):
        _write_recording(target, timed)


def _targets(poses: Sequence[Path], folder: Path) -> list[_Target]:
    from schemas.poses import recording_name
    from stages.capture.bids.labels import label, recording_stem

    found: dict[Path, _Target] = {}
    for path in poses:
        name = recording_name(path)
        if not (name.subject and name.task):
            raise InputError(f"{path}: names no subject or no task; BIDS needs both in a file's name")
        stem = folder / f"sub-{label(name.subject)}" / "motion" / recording_stem(name)
        if stem in found:
            raise InputError(
                f"{path}: is of {name}, as {found[stem].poses} is; give each recording its trial"
            )
        found[stem] = _Target(path, name, stem)
    return list(found.values())


def _check_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; expected a folder for the dataset")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "dataset_description.json").is_file():
        raise InputError(
            f"{folder}: holds files but no dataset_description.json; expected a new folder or a BIDS dataset"
        )


def _check_absent(target: _Target) -> None:
    for ending in _ENDINGS:
        if target.file(ending).exists():
            raise InputError(
                f"{target.file(ending)}: is there already; give --overwrite to replace the recording"
            )


def _write_dataset_files(folder: Path) -> None:
    from schemas import PROGRAM, VERSION
    from schemas.files import write_text

    description = {
        "Name": folder.resolve().name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": PROGRAM, "Version": VERSION}],
    }
    if not (folder / "dataset_description.json").exists():
        write_text(folder / "dataset_description.json", _json(description))
    if not any(folder.glob("README*")):
        write_text(folder / "README", _README)


def _write_participants(path: Path, subjects: Sequence[str]) -> None:
    """Add the subjects that the table does not have; its columns and rows stay as they are."""
    from schemas.files import write_text
    from stages.capture.bids.labels import label
    from stages.capture.bids.sidecars import read_rows

    header, rows = read_rows(path) if path.exists() else (["participant_id", "name"], [])
    if "participant_id" not in header:
        raise InputError(f"{path}: column participant_id is missing; found {', '.join(header)}")
    known = {row[header.index("participant_id")] for row in rows}
    fresh = [subject for subject in dict.fromkeys(subjects) if f"sub-{label(subject)}" not in known]
    for subject in fresh:
        cells = {"participant_id": f"sub-{label(subject)}", "name": " ".join(subject.split())}
        rows.append([cells.get(column, "n/a") for column in header])
    if fresh:
        write_text(path, _tsv([header, *rows]))
    if not path.with_suffix(".json").exists() and "name" in header:
        told = {"name": {"Description": "The subject's name, of which participant_id is made."}}
        write_text(path.with_suffix(".json"), _json(told))


def _write_recording(target: _Target, timed: Timing) -> None:
    from schemas.files import file_sha256, write_text
    from stages.capture.bids.recording import channels_json, motion_columns, motion_json, read_grid

    grid = read_grid(target.poses)
    columns = motion_columns(grid)
    inputs = {target.poses.name: file_sha256(target.poses)}
    rows = [column.row for column in columns]
    _write_motion(target.file("_motion.tsv"), columns)
    write_text(target.file("_motion.json"), _json(motion_json(grid, columns, timed, inputs)))
    write_text(target.file("_channels.tsv"), _tsv([list(rows[0]), *(list(row.values()) for row in rows)]))
    write_text(target.file("_channels.json"), _json(channels_json()))


def _write_motion(path: Path, columns: Sequence[Column]) -> None:
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    from schemas.files import replacing

    table = pa.table({column.name: column.text.fill_null("n/a") for column in columns})
    options = pa_csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    with replacing(path) as temporary:
        pa_csv.write_csv(table, temporary, options)


def _tsv(records: Sequence[Sequence[str]]) -> str:
    return "".join("\t".join(record) + "\n" for record in records)


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, ensure_ascii=False, indent=2) + "\n"
