"""Command line: emulate a tracker on a port, or write what it would send into a raw capture."""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import closing
from pathlib import Path

from shukotsu import command_line
from shukotsu.errors import InputError

_LOCAL_HOSTS = ("127.0.0.1", "localhost")


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu emulate",
        "Emulate a Polhemus LIBERTY on a pseudo-terminal or on a TCP port of this machine, or write a raw\n"
        "capture directly. Prints the name of the port for a recorder to open; Ctrl-C ends it.",
        "shukotsu emulate --pty /tmp/tracker --stations 1-8\n"
        "  shukotsu emulate --tcp 4001 --recording rom.parquet --layout liberty16 --loop",
    )
    where = parser.add_mutually_exclusive_group(required=True)
    add = where.add_argument
    help_text = "on a pseudo-terminal, linked to LINK"
    add("--pty", nargs="?", const=Path(), type=Path, metavar="LINK", help=help_text)
    add("--tcp", metavar="[HOST:]PORT", help="on a TCP port of 127.0.0.1; 0 takes any")
    add("--archive", type=Path, metavar="OUT", help="write a raw capture (.arrows) of --recording, no port")
    add = parser.add_argument
    add("--stations", metavar="1-16", help="connected receivers, such as 1-4,7 (default: all)")
    add("--rate", type=int, choices=(240, 120), default=240, help="frames per second at power-up")
    add("--recording", type=Path, help="play this recording instead of the built-in motion")
    add("--layout", default="liberty16", help="which segment sits on which station (default: liberty16)")
    add("--loop", action="store_true", help="begin the recording again at its end")
    return parser


def emulate(options: argparse.Namespace) -> None:
    """Check the options, then serve a port or write an archive."""
    from shukotsu.tracker.conversation import StopRequest, parse_stations, stop_on_signals
    from shukotsu.tracker.emulated_device import EmulatedLiberty, built_in_motion
    from shukotsu.tracker.emulator import Emulator, PtyPort, TcpPort, serve, write_archive

    if options.archive is not None:
        if options.recording is None:
            raise InputError("--archive: needs a recording to write; give --recording")
        if options.archive.suffix != ".arrows":
            raise InputError(f"{options.archive}: expected a name that ends with .arrows")
        if options.loop:
            raise InputError("--loop: needs a port; leave it out with --archive")
    motion = built_in_motion()
    if options.recording is not None:  # needs packages that the recorder alone lacks
        from shukotsu.readers.played_recording import read_played_recording

        motion = read_played_recording(options.recording, options.layout, loop=options.loop)
        for note in motion.notes:
            print(f"note: {options.recording}: {note}", file=sys.stderr)
    stations = motion.stations if options.stations is None else parse_stations(options.stations)
    device = EmulatedLiberty(motion, frozenset(stations), rate_hz=options.rate)
    if options.archive is not None:
        write_archive(device, options.archive, {"recording": options.recording.name})
        return
    host, _, number = (options.tcp or "0").rpartition(":")
    host = host or _LOCAL_HOSTS[0]
    if host not in _LOCAL_HOSTS or not number.isdecimal() or int(number) > 65535:
        raise InputError(f"--tcp: is {options.tcp!r}; expected a port of this machine, such as 4001")
    link = None if options.pty == Path() else options.pty
    port = PtyPort(link) if options.tcp is None else TcpPort(host, int(number))
    stop = StopRequest()
    with stop_on_signals(stop), closing(port):
        print(port.name, flush=True)
        serve(Emulator(device, port.write, time.perf_counter_ns()), port, lambda: bool(stop))


main = command_line.script(build_parser, emulate)
