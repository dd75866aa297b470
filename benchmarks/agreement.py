"""Simulated people recorded twice: differences of bone lengths relative to their expected sd."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.benchmark_table import PrintedTable, Row, of_each_person, percent
from shukotsu.fit.fit import fit_hand
from shukotsu.fit.length_pulls import pull_rows
from shukotsu.scores.agreement import ACROSS, Estimate, compare_pairs
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import LAYOUT, simulate
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import RecordingName

if TYPE_CHECKING:
    from shukotsu.tables.rows import LengthPullsRow

WRITTEN_TO = "accuracy.md", "agreement"
PEOPLE, N_FRAMES = (20, 7000), 6000
RECORDED = (("1", "rom"), ("1", "opposition"), ("2", "rom"))
KINDS = ("thumb metacarpal", "metacarpal", "proximal", "middle", "distal")


def run(n_hands: int, seed: int) -> Iterator[PrintedTable]:
    """Yield the table over n_hands people: both hands, two sessions and two recordings of each."""
    rows = [row for person in of_each_person(one_person, n_hands, seed) for row in person]
    table: list[Row] = []
    for across in ACROSS:
        for kind in ("all", *KINDS):
            z = np.array([r["z"] for r in rows if r["across"] == across and kind in ("all", r["kind"])])
            inside = percent(np.abs(z) <= 1.96)
            table.append((across, kind, len(z), float(np.sqrt(np.mean(z**2))), float(z.std()), inside))
    columns = ("across", "bones", "pairs:d", "times expected:.2f", "sd of z:.2f", "in 95 %:.0f")
    meaning = (
        "z: difference of two lengths of one bone over its expected sd. Session: receivers put on again and "
        "movements repeated. Hand: right and left hand of one session. Recording: range of motion and "
        "opposition of one session. Times expected: root mean square of z, 1 if errors are as stated."
    )
    yield PrintedTable("people recorded twice", columns, table, meaning)


def one_person(seed: int) -> list[dict[str, Any]]:
    """Return a person's compared pairs, with the kind of bone."""
    pulls: list[tuple[str, str, str, LengthPullsRow]] = []
    for hand in ("right", "left"):
        for session, task in RECORDED:
            name = RecordingName("01", hand, task, session=session)
            poses = simulate(name, seed, Realism(), N_FRAMES)
            fit = fit_hand([poses], read_layout(LAYOUT), hand)
            pulls += [(row["bone"], hand, f"{session} {task}", row) for row in pull_rows(fit)]
    rows = []
    by_bone = sorted(pulls, key=lambda pull: pull[:3])
    for bone, of_bone in groupby(by_bone, key=lambda pull: pull[0]):
        estimates = [
            Estimate.of([row for *_, row in each], recorded[0], hand, [recorded], is_whole="rom" in recorded)
            for (_, hand, recorded), each in groupby(of_bone, key=lambda pull: pull[:3])
        ]
        kind = "thumb metacarpal" if bone == "thumb_metacarpal" else bone.split("_")[1]
        rows += [row | {"kind": kind} for row in compare_pairs(estimates)]
    return rows
