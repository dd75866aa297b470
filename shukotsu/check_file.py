"""Command line: read a study as a run would, or say of a recording whether it went well."""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

from schemas.errors import InputError
from shukotsu.study_file import USUAL, read_files
from stages import command_line

STUDY_ENDINGS = (".yaml", ".yml", ".json")


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu check",
        "Read a study file and all that it names as a run would, and name what it reads outside its folder. "
        "Of a recording: say what contradicts what was declared, and which joints should move more.",
        "shukotsu check study.yaml\n  shukotsu check rom.csv --hand right",
        records_failure=False,
    )
    parser.add_argument(
        "file", nargs="?", type=Path, default=USUAL, metavar="STUDY_OR_RECORDING", help=f"default: {USUAL}"
    )
    recording = parser.add_argument_group("of a recording")
    recording.add_argument("--hand", choices=("right", "left"), help="which hand it is of")
    recording.add_argument("--layout", default="liberty16", help="a layout that ships, or a path (liberty16)")
    recording.add_argument("--mapping", type=Path, help="how the file is to be read, where it needs that")
    recording.add_argument(
        "--repair-hemisphere", action="store_true", help="put back what is on the transmitter's other side"
    )
    return parser


def check(arguments: argparse.Namespace) -> None:
    """Check the study or the recording. Raises InputError as a run would."""
    if arguments.file.suffix.lower() in STUDY_ENDINGS:
        check_study(arguments.file)
    else:
        check_recording(
            arguments.file,
            arguments.hand,
            arguments.layout,
            arguments.mapping,
            repair_hemisphere=arguments.repair_hemisphere,
        )


def check_study(path: Path) -> None:
    """Print what a study is, and what it reads outside its folder; raise InputError as a run would.

    Snakemake runs code in a file that asks for it; this runs none.
    """
    from schemas.study import unmatched_rows

    files = read_files(path)
    study = files.study
    counts = f"{len(study.subjects)} subjects, {len(study.recordings)} recordings, {len(study.models)} models"
    print(f"{path}: study {study.name}, {counts}")
    for row in study.unusable:
        print(f"note: {row.message}")
    for problem in unmatched_rows(study):
        print(f"note: {problem}")
    print("note: the poses are read when it runs; `shukotsu check RECORDING` reads one")
    shipped, folder = Path(__file__).parents[1] / "config", path.resolve().parent
    read = [*map(Path, files.configuration), *(recording.file for recording in study.recordings)]
    read += [recording.mapping for recording in study.recordings if recording.mapping is not None]
    for each in sorted({Path(os.path.realpath(each)) for each in read}):  # of a link to itself, itself
        if not each.is_relative_to(folder) and not each.is_relative_to(shipped):
            print(f"note: reads {each}, outside the study's folder")


def check_recording(
    path: Path, hand: str | None, layout: str, mapping: Path | None, *, repair_hemisphere: bool = False
) -> None:
    """Import a recording into a folder that is removed again; print its findings, or else joints' advice."""
    from schemas.findings import SUSPECT
    from schemas.layout import read_layout
    from stages.capture import import_recording
    from stages.solve_joints import check_calibration

    if hand is None:
        raise InputError(f"{path}: --hand is missing; say which hand the recording is of, right or left")
    with tempfile.TemporaryDirectory() as folder:
        poses = Path(folder, "poses.parquet")
        who = [f"--in={path}", f"--layout={layout}", f"--hand={hand}", "--subject=-", "--task=-"]
        who += [] if mapping is None else [f"--mapping={mapping}"]
        who += ["--repair-hemisphere"] if repair_hemisphere else []
        silent = ["--record-failure", f"--out={poses}"]  # leaves findings to the lines below
        import_recording.import_recording(import_recording.build_parser().parse_args([*who, *silent]))
        findings = command_line.checked_poses(poses, read_layout(layout).of_hand(hand)).findings
        for finding in findings:
            print(f"{finding.severity}: {finding.kind}: {finding.message}")
        if any(finding.severity == SUSPECT for finding in findings):
            return  # before that is settled, nothing can be said of joints
        print("" if findings else "no finding\n", end="")
        of_hand = [f"--poses={poses}", f"--layout={layout}"]
        check_calibration.check(check_calibration.build_parser().parse_args(of_hand))


def main(argv: list[str]) -> int:
    """Check; give the exit code."""
    return command_line.run(build_parser().parse_args(argv), check)
