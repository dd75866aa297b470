"""Command line: the ports at which a tracker may be."""

from __future__ import annotations

import argparse

from stages.capture import tracker_options


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    return tracker_options.parser(
        "devices",
        "List the serial ports of this machine and the trackers on its USB.",
        "python -m stages.capture devices",
    )


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return tracker_options.run(build_parser().parse_args(argv), list_devices)


def list_devices(options: argparse.Namespace) -> int:
    """Print what there is."""
    from trackers.record.connected_ports import port_lines, serial_ports, usb_devices

    del options
    print("\n".join(port_lines(serial_ports(), usb_devices())))
    return 0
