"""Command line: raw archive -> table of records."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu.stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu decode",
        "Turn a raw capture into a table of every record that the tracker sent. The same capture gives the\n"
        "same table, byte for byte; the capture is never changed.",
        "shukotsu decode --in rom.arrows --out rom_records.parquet",
        records_failure=False,
    )
    parser.add_argument("--in", dest="capture", type=Path, required=True, help="the raw capture (.arrows)")
    parser.add_argument("--out", type=Path, required=True, help="the table of records to write (.parquet)")
    return parser


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return command_line.run(build_parser, argv, decode)


def decode(options: argparse.Namespace) -> None:
    """Decode the capture; what is wrong with it goes to stderr, a line of totals to stdout."""
    from shukotsu.schemas.catalogue import CAPTURE_RECORDS
    from shukotsu.schemas.tables import Provenance, write_table_in_parts
    from shukotsu.trackers.archive import open_archive
    from shukotsu.trackers.decode.findings import facts, findings
    from shukotsu.trackers.decode.records_table import flagged_records, table_columns
    from shukotsu.trackers.decode.survey import survey_archive

    archive = open_archive(options.capture)
    survey = survey_archive(archive)
    sentences = findings(survey)
    for sentence in sentences:
        print(f"note: {options.capture}: {sentence}", file=sys.stderr)
    provenance = Provenance.of(
        [options.capture],
        about=dict(archive.about),
        found=sentences,
        **facts(survey),
    )
    parts = (table_columns(part) for part in flagged_records(archive, survey))
    rows = write_table_in_parts(options.out, CAPTURE_RECORDS, parts, provenance)
    losses = survey.losses
    print(
        f"{options.out}: {rows} records of {len(survey.records)} receivers in {survey.frames} frames, "
        f"{losses.all.lost} frames missing ({losses.lost_records} records), "
        f"{losses.partial_cycles} partial, {survey.skipped_bytes} bytes skipped"
    )
