"""Faults of the machine against what is promised: kills, full disks, little memory, changed files."""

from benchmarks.faults.matrix import add_options, run

__all__ = ["add_options", "run"]
