"""Simulated hands against their truth: how far every estimator is off, and whether its sd says so."""

from __future__ import annotations

import argparse

from benchmarks.accuracy.running import run
from benchmarks.accuracy.scenarios import BY_KEY, Scenario

__all__ = ["WRITTEN_TO", "add_options", "add_people", "run"]

WRITTEN_TO = "accuracy.md", "tables"
FIRST_SEED = 5200
"""Of the documented run; seeds below are for development."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    add_people(parser)
    parser.add_argument(
        "--scenarios",
        type=_scenarios,
        help=f"run these alone, side by side, e.g. ct,blend: {', '.join(BY_KEY)}",
    )


def add_people(parser: argparse.ArgumentParser) -> None:
    """Declare which simulated people are taken."""
    people = parser.add_mutually_exclusive_group()
    people.add_argument(
        "--hands",
        dest="seeds",
        type=_hands,
        default=range(FIRST_SEED, FIRST_SEED + 10),
        help="so many hands, right and left of each seed (default: 20)",
    )
    people.add_argument(
        "--seeds", type=_range, help=f"first-last, both included, in place of --hands from {FIRST_SEED}"
    )


def _hands(text: str) -> range:
    if not text.isdigit() or int(text) < 2 or int(text) % 2:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of hands; expected an even one, e.g. 20")
    return range(FIRST_SEED, FIRST_SEED + int(text) // 2)


def _range(text: str) -> range:
    first, _, last = text.partition("-")
    if not first.isdigit() or not (last or first).isdigit() or int(last or first) < int(first):
        raise argparse.ArgumentTypeError(f"{text!r} is no range of seeds; expected e.g. 5000-5009")
    return range(int(first), int(last or first) + 1)


def _scenarios(text: str) -> list[Scenario]:
    unknown = [key for key in text.split(",") if key not in BY_KEY]
    if unknown:
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is no scenario; expected of {', '.join(BY_KEY)}")
    return [BY_KEY[key] for key in text.split(",")]
