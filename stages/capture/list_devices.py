"""Command line: the ports at which a tracker may be."""

from __future__ import annotations

import argparse

from shukotsu.stages import command_line


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    return command_line.parser(
        "shukotsu devices",
        "List the serial ports of this machine, the trackers on its USB, and LSL streams that have poses.",
        "shukotsu devices",
        records_failure=False,
    )


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return command_line.run(build_parser, argv, list_devices)


def list_devices(options: argparse.Namespace) -> None:
    """Print what there is."""
    from shukotsu.trackers.lsl.port import stream_lines
    from shukotsu.trackers.record.connected_ports import NETWORK, port_lines, serial_ports, usb_devices

    del options
    print("\n".join([*port_lines(serial_ports(), usb_devices()), *stream_lines(), NETWORK]))
