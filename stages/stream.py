"""Command line: convert a recording to the raw capture that the recorder of a tracker would have made."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu import command_line


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage stream",
        "Write the raw capture of a tracker that plays a recording, each segment on its receiver's station.",
        "shukotsu stage stream --recording rom.parquet --layout liberty16 --out rom.arrows",
    )
    parser.add_argument("--recording", type=Path, required=True, help="in any format that needs no mapping")
    parser.add_argument("--layout", default="liberty16", help="a layout that ships, or a path")
    parser.add_argument("--out", type=Path, required=True, help="the raw capture to write (.arrows)")
    return parser


def stream(arguments: argparse.Namespace) -> None:
    """Play the recording on the emulated tracker and write what it sends to the capture."""
    from shukotsu.readers.played_recording import read_played_recording
    from shukotsu.tracker.emulated_device import EmulatedLiberty
    from shukotsu.tracker.emulator import write_archive

    motion = read_played_recording(arguments.recording, arguments.layout)
    for note in motion.notes:
        print(f"note: {arguments.recording}: {note}", file=sys.stderr)
    device = EmulatedLiberty(motion, frozenset(motion.stations))
    write_archive(device, arguments.out, {"recording": arguments.recording.name})


main = command_line.script(build_parser, stream)


if __name__ == "__main__":
    raise SystemExit(main())
