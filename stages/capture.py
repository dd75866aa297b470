"""Command line: convert a recording's file to a poses table (section 2 of the paper)."""

from __future__ import annotations

from shukotsu import command_line
from shukotsu.readers.import_recording import build_parser, import_recording, record_failure

main = command_line.script(build_parser, import_recording, record_failure)


if __name__ == "__main__":
    raise SystemExit(main())
