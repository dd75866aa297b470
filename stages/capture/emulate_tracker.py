"""Command line of the emulator."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.errors import InputError
from shukotsu.stages import command_line
from shukotsu.trackers.emulate.faults import FAULTS, LineFault, Plug, parse_fault, parse_time
from shukotsu.trackers.families import FAMILIES, USUAL

if TYPE_CHECKING:
    from shukotsu.trackers.emulate.device import EmulatedDevice
    from shukotsu.trackers.emulate.emulator import Behaviour
    from shukotsu.trackers.emulate.pose_sources import Motion
    from shukotsu.trackers.emulate.server import Port

DEVICES = tuple(name for name, family in FAMILIES.items() if family.emulated_device and not family.scheme)
IGTL = "openigtlink"
FASTEST_HZ = 240
MESSAGES = ("transform", "tdata", "qtdata", "position")

_LOCAL_HOSTS = ("127.0.0.1", "localhost")
_PUSH_S = 0.004
_LAST_BYTES_S = 0.05
"""A client gets so long to read what came before the device vanished; a hung-up terminal drops it."""

_EXAMPLE = """shukotsu emulate --pty /tmp/tracker --stations 1-8
  shukotsu emulate --tcp 4001 --recording rom.parquet --layout liberty16 --loop \\
      --unplug 3@5 --plug 3@8 --drop-bytes 1e-5"""


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu emulate",
        "Be a Polhemus LIBERTY, PATRIOT or FASTRAK for a recorder, or a server of OpenIGTLink: on a\n"
        "pseudo-terminal, on a TCP port of this machine, or straight into a raw capture. Prints what a\n"
        "client is to open; ends with Ctrl-C.",
        _EXAMPLE,
        records_failure=False,
    )
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--pty",
        nargs="?",
        const=Path(),
        type=Path,
        metavar="LINK",
        help="on a pseudo-terminal, linked to LINK",
    )
    where.add_argument("--tcp", metavar="[HOST:]PORT", help="on a TCP port of 127.0.0.1; 0 takes any")
    where.add_argument("--igtl", metavar="[HOST:]PORT", help="the same, as a server of OpenIGTLink")
    where.add_argument("--lsl", metavar="NAME", help="as an LSL stream of type MoCap, named by --layout")
    where.add_argument(
        "--archive", type=Path, metavar="OUT", help="write a raw capture (.arrows) of --recording, at once"
    )
    _add_device(parser.add_argument_group("the device"))
    _add_line(parser.add_argument_group("the line"))
    _add_faults(parser.add_argument_group("what goes wrong (times from the start of the stream; repeatable)"))
    return parser


def _add_device(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--device", choices=DEVICES, help=f"default: {USUAL}")
    add("--message", choices=MESSAGES, help=f"of --igtl; default: {MESSAGES[0]}")
    add("--stations", metavar="1-16", help="plugged receivers, such as 1-4,7 (default: all)")
    add("--ports", type=int, help="connectors of a LIBERTY: 4, 8, 12 or 16 (default: 16)")
    add("--rate", type=int, help="frames a second at power-up: 240 or 120 (default: 240)")
    add("--recording", type=Path, help="play this recording instead of the built-in motion")
    add("--layout", default="liberty16", help="which segment sits on which station (default: liberty16)")
    add("--loop", action="store_true", help="begin the recording again at its end")
    add("--power-up-text", action="store_true", help="start by starting up: deaf first, then the ready text")
    add("--reinit-delay", type=float, default=8.0, metavar="S", help="how long starting takes (default: 8)")
    add(
        "--already-streaming",
        action="store_true",
        help="as an earlier client left it: binary, cm, another list",
    )
    add("--echo", action="store_true", help="echo what is received (^E1)")


def _add_line(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--line-rate", type=float, metavar="BYTES_PER_S", help="115200 baud carry 11520 (default: no limit)")
    add("--fifo", type=int, metavar="BYTES", help="kept for a busy line, the rest is lost (default: 2300)")
    add("--baud", type=int, help="a pseudo-terminal's client at another speed reads garbage")


def _add_faults(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    for name, (metavar, text) in FAULTS.items():
        add(f"--{name}", action="append", default=[], metavar=metavar, help=text)
    add("--seed", type=int, default=0, help="same seed, same damage (default: 0)")
    add("--silent", action="store_true", help="never answer")
    add("--gone-at", metavar="T", help="vanish in the middle of a record")


def main(argv: list[str]) -> int:
    """Run the emulator until Ctrl-C, SIGTERM or its own end; gives the exit code."""
    return command_line.run(build_parser, argv, emulate)


def emulate(options: argparse.Namespace) -> None:
    """Check the options; then serve a port, or write an archive."""
    _check(options)
    if options.archive is not None:
        _write_archive(options)
    elif options.lsl is not None:
        _send(options)
    else:
        _serve(options)


def _check(options: argparse.Namespace) -> None:
    _choose_device(options)
    family = FAMILIES[options.device]
    options.ports = options.ports or family.ports[-1]
    rates_hz = family.rates_hz or range(FASTEST_HZ, 0, -1)
    options.rate = options.rate or rates_hz[0]
    for name, known in (("ports", family.ports), ("rate", rates_hz)):
        value = getattr(options, name)
        if value not in known:
            choices = f"1 to {FASTEST_HZ}" if isinstance(known, range) else ", ".join(map(str, known))
            raise InputError(f"--{name}: is {value}; expected one that a {options.device} has: {choices}")
    if options.baud is not None and options.pty is None:
        raise InputError("--baud: only a pseudo-terminal has a speed; give --pty")
    for name in ("line_rate", "fifo", "baud"):
        value = getattr(options, name)
        if value is not None and not value > 0:
            raise InputError(f"--{name.replace('_', '-')}: is {value}; expected more than 0")
    if not 0 <= options.reinit_delay < 3600:
        raise InputError(f"--reinit-delay: is {options.reinit_delay:g}; expected seconds below 3600")
    if options.archive is not None:
        _check_archive(options)


def _choose_device(options: argparse.Namespace) -> None:
    """Say which device it is; refuse options that only trackers on a line have, or only a server."""
    stream = "igtl" if options.igtl is not None else "lsl" if options.lsl is not None else ""
    not_of_it = ("device", "already_streaming", "echo", "power_up_text") if stream else ()
    for name in (*not_of_it, *(() if stream == "igtl" else ("message",))):
        if getattr(options, name):
            other = f"--{stream}" if name in not_of_it else "a device other than --igtl"
            raise InputError(f"--{name.replace('_', '-')}: is not for {other}; leave it out")
    options.message = options.message or MESSAGES[0]
    if stream == "igtl":
        options.tcp = options.igtl
    options.device = IGTL if stream == "igtl" else options.device or USUAL


def _check_archive(options: argparse.Namespace) -> None:
    if options.recording is None:
        raise InputError("--archive: needs a recording to write; give --recording")
    if options.archive.suffix != ".arrows":
        raise InputError(f"{options.archive}: is to be a raw capture; give it the ending .arrows")
    if options.device != "liberty":
        raise InputError(f"--archive: is written of a liberty only; not with --device {options.device}")
    for name in ("silent", "gone_at", "power_up_text", "echo", "loop"):
        if getattr(options, name):
            raise InputError(f"--{name.replace('_', '-')}: needs a port; leave it out with --archive")


def _serve(options: argparse.Namespace) -> None:
    from shukotsu.trackers.emulate.emulator import Emulator
    from shukotsu.trackers.emulate.server import serve

    device = _device(options, _motion(options))
    behaviour = _behaviour(options)
    port = _open(options)
    signals = _on_signals()
    emulator = Emulator(device, behaviour, port.write, time.perf_counter_ns())
    print(port.name, flush=True)
    try:
        serve(emulator, port, lambda: bool(signals))
        if emulator.gone:
            time.sleep(_LAST_BYTES_S)
    finally:
        port.close()


def _send(options: argparse.Namespace) -> None:
    """Send the poses, without a device or a line between, until a signal or the recording's end."""
    import numpy as np

    from shukotsu.schemas.layout import read_layout
    from shukotsu.trackers.lsl.outlet import Outlet
    from shukotsu.trackers.protocols.stream_settings import StreamSettings

    if options.line_rate or options.silent or options.gone_at or _faults(options):
        raise InputError("--lsl: has no line that could be slow or faulty; leave these options out")
    motion, layout = _motion(options), read_layout(options.layout)
    stations = sorted(_device(options, motion).world.plugged)
    segments = {segment.receiver: name for name, segment in layout.segments.items()}
    names = {str(station): segments.get(station, str(station)) for station in stations}
    settings = StreamSettings("lsl", "binary", "mm", options.rate, tuple(stations), options={"names": names})
    outlet = Outlet(options.lsl, settings, "the moments for which poses are computed")
    ended = _on_signals()
    print(f"lsl:{options.lsl}", flush=True)
    start_s, sent = time.perf_counter(), 0
    while not ended and (motion.loop or sent < motion.cycles):
        time.sleep(_PUSH_S)
        due = np.arange(sent, int((time.perf_counter() - start_s) * options.rate))
        outlet.push(np.concatenate(motion.poses(due, stations), -1), start_s + due / options.rate)
        sent += len(due)


def _on_signals() -> list[int]:
    """Give a list that has a member once the program is asked to end."""
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: signals.append(received))
    return signals


def _open(options: argparse.Namespace) -> Port:
    from shukotsu.trackers.emulate.server import TcpPort

    if options.tcp is None:
        try:
            from shukotsu.trackers.emulate.pseudo_terminal import PtyPort
        except ModuleNotFoundError as error:
            raise InputError("--pty: this system has no pseudo-terminals; give --tcp 4001") from error
        return PtyPort(None if options.pty == Path() else options.pty, options.baud)
    host, _, number = options.tcp.rpartition(":")
    if (host or _LOCAL_HOSTS[0]) not in _LOCAL_HOSTS or not number.isdecimal() or int(number) > 65535:
        option = "--tcp" if options.igtl is None else "--igtl"
        raise InputError(f"{option}: is {options.tcp!r}; expected a port of this machine, such as 4001")
    port = TcpPort(host or _LOCAL_HOSTS[0], int(number))
    if options.igtl is not None:
        port.name = port.name.replace("socket:", "igtl:")
    return port


def _device(options: argparse.Namespace, motion: Motion) -> EmulatedDevice:
    from shukotsu.trackers.emulate.device import OutputListDevice, World, emulated_device
    from shukotsu.trackers.record.request import parse_stations

    stations = {station for station in motion.stations if station <= options.ports}
    if options.stations is not None:
        stations = set(parse_stations(options.stations, options.ports))
    plugs = tuple(fault for fault in _faults(options) if isinstance(fault, Plug))
    world = World(motion, frozenset(stations), plugs, options.reinit_delay)
    how = {"message": options.message} if options.device == IGTL else {}
    device = emulated_device(options.device, world, options.ports, options.rate, **how)
    if options.echo:
        device.receive(b"\x05" + b"1\r")
    if options.already_streaming:
        assert isinstance(device, OutputListDevice), "others refuse the option"
        device.power_up_streaming()
    if options.power_up_text:
        device.start_up()
    return device


def _faults(options: argparse.Namespace) -> list[Plug | LineFault]:
    faults = []
    for name in FAULTS:
        for text in getattr(options, name.replace("-", "_")):
            fault = parse_fault(name, text)
            if isinstance(fault, Plug) and fault.station > options.ports:
                raise InputError(f"--{name}: is {text!r}; expected a station from 1 to {options.ports}")
            faults.append(fault)
    return faults


def _behaviour(options: argparse.Namespace) -> Behaviour:
    from shukotsu.trackers.emulate.emulator import FIFO_BYTES, Behaviour

    gone_at = None if options.gone_at is None else parse_time("gone-at", options.gone_at)
    faults = tuple(fault for fault in _faults(options) if isinstance(fault, LineFault))
    return Behaviour(
        options.line_rate, options.fifo or FIFO_BYTES, options.silent, gone_at, faults, options.seed
    )


def _motion(options: argparse.Namespace) -> Motion:
    from shukotsu.trackers.emulate.pose_sources import built_in_motion

    if options.recording is None:
        return built_in_motion()
    motion = read_motion(options.recording, options.layout, loop=options.loop, last_station=options.ports)
    for note in motion.notes:
        print(f"note: {options.recording}: {note}", file=sys.stderr)
    return motion


def read_motion(path: Path, layout_name: str, *, loop: bool = False, last_station: int = 16) -> Motion:
    """Read a recording in any format that needs no mapping; each segment plays on its receiver's station.

    Segments whose receiver number is beyond `last_station` are left out and noted. Raises InputError where
    the file is no recording, or where none of its segments has a station.
    """
    import numpy as np

    from shukotsu.schemas.layout import read_layout
    from shukotsu.stages.capture.formats.readers import AUTO, find_reader
    from shukotsu.trackers.emulate.pose_sources import recorded_motion

    layout = read_layout(layout_name)
    samples = find_reader(path, AUTO)(path, layout, None)
    receivers = np.array([layout.segments[name].receiver or 0 for name in samples.segments])
    receivers[receivers > last_station] = 0
    station = receivers[samples.segment]
    if not station.any():
        raise InputError(
            f"{path}: none of its segments has a station from 1 to {last_station} in layout {layout.name}; "
            "give the layout's segments such `receiver:` numbers"
        )
    notes = [
        f"segment {samples.segments[index]} has no station from 1 to {last_station}; not played"
        for index in np.unique(samples.segment[station == 0])
    ]
    poses = samples.numbers
    return recorded_motion(samples.frame, station, poses[:, :3], poses[:, 3:], loop=loop, notes=notes)


def _write_archive(options: argparse.Namespace) -> None:
    from shukotsu.trackers.liberty.emulated_capture import write_archive
    from shukotsu.trackers.liberty.emulated_device import EmulatedLiberty

    motion = _motion(options)
    device = _device(options, motion)
    assert isinstance(device, EmulatedLiberty)
    about = {"recording": options.recording.name, "seed": options.seed}
    write_archive(device, motion, options.archive, _behaviour(options), about)
