"""Command line of the emulator."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import InputError
from stages.capture.emulate.faults import FAULTS, BitErrors, LineFault, SensorFault, parse_fault, parse_time
from stages.command_line import EXIT_BAD_INPUT

if TYPE_CHECKING:
    from stages.capture.emulate.device import Device, World
    from stages.capture.emulate.emulator import Behaviour
    from stages.capture.emulate.poses_source import BuiltInMotion, Crossing, RecordedMotion
    from stages.capture.emulate.serve import Port

DEVICES = ("liberty", "patriot", "fastrak")
PORTS = {"liberty": (4, 8, 12, 16), "patriot": (2,), "fastrak": (4,)}
RATES_HZ = {"liberty": (240, 120), "patriot": (60,), "fastrak": (120,)}

_LOCAL_HOSTS = ("127.0.0.1", "localhost")
_LAST_WORDS_S = 0.05
"""A client gets so long to read what came before the device vanished; a hung-up terminal drops it."""

_EXAMPLE = """python -m stages.capture emulate --pty /tmp/tracker --stations 1-8
  python -m stages.capture emulate --tcp 4001 --recording rom.parquet --layout liberty16 --loop \\
      --unplug 3@5 --plug 3@8 --drop-bytes 1e-5 --truth truth.parquet"""


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = argparse.ArgumentParser(
        prog="python -m stages.capture emulate",
        description="Be a Polhemus LIBERTY, PATRIOT or FASTRAK for a recorder: on a pseudo-terminal, on a\n"
        "TCP port of this machine, or straight into a raw capture. Prints what a client is to open;\n"
        "ends with Ctrl-C.",
        epilog=f"example:\n  {_EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
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
    where.add_argument(
        "--archive", type=Path, metavar="OUT", help="write a raw capture (.arrows) of --recording, at once"
    )
    _add_device(parser.add_argument_group("the device"))
    _add_line(parser.add_argument_group("the line"))
    _add_faults(parser.add_argument_group("what goes wrong (times from the start of the stream; repeatable)"))
    return parser


def _add_device(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--device", choices=DEVICES, default="liberty", help="default: liberty")
    group.add_argument("--stations", metavar="1-16", help="plugged receivers, such as 1-4,7 (default: all)")
    group.add_argument("--ports", type=int, help="connectors of a LIBERTY: 4, 8, 12 or 16 (default: 16)")
    group.add_argument("--rate", type=int, help="frames a second at power-up: 240 or 120 (default: 240)")
    group.add_argument("--recording", type=Path, help="play this recording instead of the built-in motion")
    group.add_argument(
        "--layout", default="liberty16", help="which segment sits on which station (default: liberty16)"
    )
    group.add_argument("--loop", action="store_true", help="begin the recording again at its end")
    group.add_argument(
        "--cross-hemisphere", action="store_true", help="carry the hand through X = 0 and back every 8 s"
    )
    group.add_argument("--start-frame", type=int, default=0, metavar="N", help="frame count at power-up")
    group.add_argument(
        "--power-up-text", action="store_true", help="start by starting up: deaf first, then the ready text"
    )
    group.add_argument(
        "--reinit-delay", type=float, default=8.0, metavar="S", help="how long starting takes (default: 8)"
    )
    group.add_argument(
        "--already-streaming",
        action="store_true",
        help="as an earlier client left it: binary, cm, another list",
    )
    group.add_argument("--echo", action="store_true", help="echo what is received (^E1)")


def _add_line(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--line-rate", type=float, metavar="BYTES_PER_S", help="115200 baud carry 11520 (default: no limit)"
    )
    group.add_argument("--baud", type=int, help="a pseudo-terminal's client at another speed reads garbage")
    group.add_argument("--truth", type=Path, help="write what was done to which byte, .parquet or .csv")


def _add_faults(group: argparse._ArgumentGroup) -> None:
    for name, option in FAULTS.items():
        group.add_argument(f"--{name}", action="append", default=[], metavar=option.metavar, help=option.help)
    group.add_argument("--seed", type=int, default=0, help="same seed, same damage (default: 0)")
    group.add_argument("--silent", action="store_true", help="never answer")
    group.add_argument("--gone-at", metavar="T", help="vanish in the middle of a record")


def main(arguments: list[str]) -> int:
    """Run the emulator until Ctrl-C, SIGTERM or its own end; gives the exit code."""
    options = build_parser().parse_args(arguments)
    try:
        _check(options)
        if options.archive is not None:
            _write_archive(options)
        else:
            _serve(options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    return 0


def _check(options: argparse.Namespace) -> None:
    device = options.device
    options.ports = options.ports or PORTS[device][-1]
    if options.ports not in PORTS[device]:
        known = ", ".join(map(str, PORTS[device]))
        raise InputError(f"--ports: is {options.ports}; expected one that a {device} has: {known}")
    options.rate = options.rate or RATES_HZ[device][0]
    if options.rate not in RATES_HZ[device]:
        known = ", ".join(map(str, RATES_HZ[device]))
        raise InputError(f"--rate: is {options.rate}; expected one that a {device} has: {known}")
    if options.baud is not None and options.pty is None:
        raise InputError("--baud: only a pseudo-terminal has a speed; give --pty")
    for name in ("line_rate", "baud"):
        value = getattr(options, name)
        if value is not None and not value > 0:
            raise InputError(f"--{name.replace('_', '-')}: is {value}; expected more than 0")
    if not 0 <= options.reinit_delay < 3600 or not 0 <= options.start_frame < 1 << 32:
        raise InputError("--reinit-delay, --start-frame: expected seconds below 3600 and a frame below 2^32")
    if options.archive is not None:
        _check_archive(options)
    if options.truth is not None:
        from stages.capture.emulate.truth import check_ending

        check_ending(options.truth)


def _check_archive(options: argparse.Namespace) -> None:
    if options.recording is None:
        raise InputError("--archive: needs a recording to write; give --recording")
    if options.archive.suffix != ".arrows":
        raise InputError(f"{options.archive}: is to be a raw capture; give it the ending .arrows")
    if options.device != "liberty":
        raise InputError(f"--archive: is written of a liberty only; not with --device {options.device}")
    unfit = ("silent", "gone_at", "power_up_text", "echo", "loop", "start_frame")
    for name in unfit:
        if getattr(options, name):
            raise InputError(f"--{name.replace('_', '-')}: needs a port; leave it out with --archive")


def _serve(options: argparse.Namespace) -> None:
    from stages.capture.emulate.emulator import Emulator
    from stages.capture.emulate.line import Line
    from stages.capture.emulate.serve import serve
    from stages.capture.emulate.truth import Truth

    device = _device(options, _motion(options))
    behaviour = _behaviour(options)
    truth = None if options.truth is None else Truth()
    port = _open(options)
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: signals.append(received))
    emulator = Emulator(device, Line(options.line_rate), behaviour, truth, port.write, time.monotonic_ns())
    print(port.name, flush=True)
    try:
        serve(emulator, port, lambda: bool(signals))
        if emulator.gone:
            time.sleep(_LAST_WORDS_S)
    finally:
        port.close()
        if truth is not None:
            truth.write(options.truth)


def _open(options: argparse.Namespace) -> Port:
    from stages.capture.emulate.serve import PtyPort, TcpPort

    if options.tcp is None:
        return PtyPort(None if options.pty == Path() else options.pty, options.baud)
    host, _, number = options.tcp.rpartition(":")
    if (host or _LOCAL_HOSTS[0]) not in _LOCAL_HOSTS or not number.isdecimal() or int(number) > 65535:
        raise InputError(f"--tcp: is {options.tcp!r}; expected a port of this machine, such as 4001")
    return TcpPort(host or _LOCAL_HOSTS[0], int(number))


def _device(options: argparse.Namespace, motion: BuiltInMotion | RecordedMotion | Crossing) -> Device:
    from stages.capture.emulate.fastrak import Fastrak
    from stages.capture.emulate.liberty import Liberty

    world = _world(options, motion)
    device: Device
    if options.device == "fastrak":
        device = Fastrak(world)
    else:
        device = Liberty(world, family=options.device, ports=options.ports, rate_hz=options.rate)
    if options.echo:
        device.receive(b"\x05" + b"1\r")
    if options.already_streaming:
        device.power_up_streaming()
    if options.power_up_text:
        device.restart()
    return device


def _world(options: argparse.Namespace, motion: BuiltInMotion | RecordedMotion | Crossing) -> World:
    from stages.capture.emulate.device import World

    faults = _faults(options)
    return World(
        motion,
        frozenset(_stations(options, motion.stations)),
        tuple(fault for fault in faults if isinstance(fault, SensorFault)),
        tuple(fault for fault in faults if isinstance(fault, BitErrors)),
        options.start_frame,
        options.reinit_delay,
    )


def _faults(options: argparse.Namespace) -> list[object]:
    given = [(name, text) for name in FAULTS for text in getattr(options, name.replace("-", "_"))]
    faults = [(name, text, parse_fault(name, text)) for name, text in given]
    for name, text, fault in faults:
        if getattr(fault, "station", 1) > options.ports:
            raise InputError(f"--{name}: is {text!r}; expected a station from 1 to {options.ports}")
    return [fault for _, _, fault in faults]


def _behaviour(options: argparse.Namespace) -> Behaviour:
    from stages.capture.emulate.emulator import Behaviour

    gone_at = None if options.gone_at is None else parse_time("gone-at", options.gone_at)
    faults = tuple(fault for fault in _faults(options) if isinstance(fault, LineFault))
    return Behaviour(options.silent, gone_at, faults, options.seed)


def _motion(options: argparse.Namespace) -> BuiltInMotion | RecordedMotion | Crossing:
    from schemas.layout import read_layout
    from stages.capture.emulate.poses_source import BuiltInMotion, crossing, read_motion

    motion: BuiltInMotion | RecordedMotion = BuiltInMotion()
    if options.recording is not None:
        motion = read_motion(
            options.recording, read_layout(options.layout), loop=options.loop, last_station=options.ports
        )
        for note in motion.notes:
            print(f"note: {options.recording}: {note}", file=sys.stderr)
    return crossing(motion) if options.cross_hemisphere else motion


def _stations(options: argparse.Namespace, moving: tuple[int, ...]) -> set[int]:
    """Read `1-4,7`; every connector that has a receiver in the motion where nothing is given."""
    if options.stations is None:
        return {station for station in moving if station <= options.ports}
    chosen: set[int] = set()
    for part in options.stations.split(","):
        first, _, last = part.partition("-")
        last = last or first
        if not (first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last) <= options.ports):
            raise InputError(
                f"--stations: is {options.stations!r}; expected some of 1-{options.ports}, such as 1-3,5"
            )
        chosen |= set(range(int(first), int(last) + 1))
    return chosen


def _write_archive(options: argparse.Namespace) -> None:
    from stages.capture.emulate.liberty import Liberty
    from stages.capture.emulate.line import Line
    from stages.capture.emulate.poses_source import Crossing, RecordedMotion
    from stages.capture.emulate.to_archive import write_archive
    from stages.capture.emulate.truth import Truth

    motion = _motion(options)
    device = _device(options, motion)
    assert isinstance(device, Liberty)
    assert isinstance(motion, RecordedMotion | Crossing)
    truth = None if options.truth is None else Truth()
    about = {"recording": options.recording.name, "seed": options.seed}
    behaviour, line = _behaviour(options), Line(options.line_rate)
    write_archive(device, motion, options.archive, behaviour, line, truth, about)
    if truth is not None:
        truth.write(options.truth)
