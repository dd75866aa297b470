"""Receivers that come loose or slide, and metal near the hand: how often each is named in a calibration."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.benchmark_table import TextTable, add_people, of_each_person
from benchmarks.faultless_hands import FINGERS, other_hand, own_hand
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.fit_hand.left_out import is_elsewhere, share_left_out, without_displaced
from shukotsu.stages.fit_hand.loose_receivers import displaced_in
from shukotsu.stages.simulate.simulation import LAYOUT

WRITTEN_TO = "mistakes-benchmark.md", "displaced"
FIRST_SEED = 9000
DURATION_S = 25.0
FAULTLESS = "nothing"

Named = tuple[str, str, str, float]
"""What is planted; what should be named; what is; the largest share left out of a receiver's frames."""


def add_options(parser: argparse.ArgumentParser) -> None:
    add_people(parser, 20, FIRST_SEED)


def run(n_hands: int = 20, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the table over that many people."""
    people = of_each_person(one_person, n_hands, seed)
    yield table_of([row for person in people for row in person])


def one_person(seed: int) -> list[Named]:
    """List the findings in a person's calibrations, with nothing planted and with one thing each."""
    rng = np.random.default_rng(seed)
    hand, finger = ("right", "left")[seed % 2], FINGERS[rng.integers(4)]
    segment = f"{finger}_{rng.choice(['proximal', 'middle'])}"
    planted: Mapping[str, tuple[str, dict[str, Any]]] = {
        "a slide of 8 mm": (f"slid {segment}", {"slide": (segment, 8.0, 4.0, 21.0)}),
        "loose by 5 mm and 8 deg": (f"loose {segment}", {"loose": (segment, 12.5, 5.0, 8.0)}),
        "metal, 12 mm": ("field", {"metal_mm": 12.0}),
    }
    rows = [
        (f"{FAULTLESS}, own", FAULTLESS, *named_in(own_hand(seed, hand, "rom").poses, hand)),
        (f"{FAULTLESS}, other", FAULTLESS, *named_in(_other(seed, hand), hand)),
    ]
    return rows + [
        (f"{name}, other", expected, *named_in(_other(seed, hand, **options), hand))
        for name, (expected, options) in planted.items()
    ]


def _other(seed: int, hand: str, **options: Any) -> Poses:
    return other_hand(seed, hand, "rom", duration_s=DURATION_S, **options).poses


def named_in(poses: Poses, hand: str) -> tuple[str, float]:
    """Name the findings in a calibration, and the largest share of a receiver's frames that is left out."""
    layout = read_layout(LAYOUT)
    fit = fit_hand([poses], layout, hand)
    displaced = displaced_in(fit, [poses])
    named = ", ".join(f"{'slid' if one.slid else 'loose'} {one.segment}" for one in displaced.loose)
    kept = without_displaced(fit, [poses], displaced)
    shares = share_left_out([poses], kept)
    left_out = max(shares.values(), default=0.0)
    if left_out and not is_elsewhere(fit, fit_hand(kept, layout, hand)):
        left_out = 0.0
    return "field" if displaced.field else named or FAULTLESS, left_out


def table_of(rows: Sequence[Named]) -> TextTable:
    """Count how often the right thing, and nothing else, is named."""
    names = [*dict.fromkeys(row[0] for row in rows)]
    groups = {name: [row for row in rows if row[0] == name] for name in names}
    columns = ("planted", "recordings:d", "named right %:.1f", "most left out %:.1f")
    cells = [
        (
            name,
            len(own),
            100 * float(np.mean([row[1] == row[2] for row in own])),
            100 * max(row[3] for row in own),
        )
        for name, own in groups.items()
    ]
    meaning = (
        "Named right: the kind and the receiver and nothing else. Left out: of the frames of the receiver "
        "that lost most, in any of the recordings."
    )
    return TextTable("Receivers that move, and metal", columns, cells, meaning)
