"""Test of stated errors without a known truth: lengths of a bone estimated twice from independent data.

On paper: docs/whole-hand.md, section 8, which states which part of an error this tests and which it cannot
test.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.fit.fit import SIDE_SD
from shukotsu.fit.frame_uncertainty import PUT_ON
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.catalogue import LENGTH_PULLS
from shukotsu.tables.typed_table import read_table, rows_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import AgreementRow, LengthPullsRow

ACROSS = ("session", "hand", "recording")
"""What may differ between two estimates of one person's bone; everything else must be the same."""

OF_BOTH_HANDS = frozenset(
    (
        *("scale", "source", "length", "base", "direction", "axis", "lean", "skew"),
        *("joint slide", "pro-supination", "breadth", "unmodelled"),
    )
)
"""Groups of unknowns that both hands of a person share, as bones and joints are mirror images."""


@dataclass(frozen=True)
class Estimate:
    """A bone's length as estimated from some recordings.

    Attributes
    ----------
    session, hand : str
        Session and hand of the recordings.
    recordings : frozenset of str
        Names of the recordings.
    is_whole : bool
        Whether no task was left out.
    length_mm, sd_mm : float
        Length and its stated error.
    pulls_mm : mapping of (str, str) to float
        Pull of the prior of each unknown (name and group) on the length.

    """

    session: str
    hand: str
    recordings: frozenset[str]
    is_whole: bool
    length_mm: float
    sd_mm: float
    pulls_mm: Mapping[tuple[str, str], float]

    @property
    def recording(self) -> str:
        """Names of the recordings, joined by ";"."""
        return ";".join(sorted(self.recordings))

    @classmethod
    def of(
        cls, pulls: Sequence[LengthPullsRow], session: str, hand: str, names: Iterable[str], *, is_whole: bool
    ) -> Estimate:
        """Build an estimate from one bone's rows of length_pulls; names : of the recordings."""
        by_unknown = {(row["unknown"], row["group"]): row["pull_mm"] for row in pulls}
        stated = pulls[0]["alone_mm"], pulls[0]["alone_sd_mm"]
        return cls(session, hand, frozenset(names), is_whole, *stated, by_unknown)

    def across(self, other: Estimate) -> str:
        """Return the single aspect (of `ACROSS`) in which two estimates differ; empty if not comparable."""
        differ = [name for name in ("session", "hand") if getattr(self, name) != getattr(other, name)]
        if not differ and self.recordings.isdisjoint(other.recordings):
            return "recording"
        return differ[0] if len(differ) == 1 and self.is_whole and other.is_whole else ""


def agreement(plans: Iterable[SubjectPlan]) -> list[AgreementRow]:
    """Compare all pairs of a subject's estimates, except of hands with a suspect or refused recording."""
    estimates: dict[tuple[str, str, str], list[Estimate]] = defaultdict(list)
    for plan in plans:
        doubted = plan.checked(plan.table("findings")).doubted
        pulls: dict[tuple[str, ...], list[LengthPullsRow]] = defaultdict(list)
        for file in plan.files_of(LENGTH_PULLS.name):
            for row in rows_of(read_table(file, LENGTH_PULLS)):
                pulls[row["hand"], row["model"], row["made_without"], row["bone"]].append(row)
        for (hand, model, made_without, bone), rows in pulls.items():
            if not doubted(hand):
                used = [recording.name for recording in plan.calibrating(hand, model, made_without)]
                estimate = Estimate.of(rows, plan.who.session, hand, used, is_whole=not made_without)
                estimates[plan.who.subject, model, bone].append(estimate)
    return [
        {"subject": subject, "model": model, "bone": bone, **pair}
        for (subject, model, bone), each in estimates.items()
        for pair in compare_pairs(each)
    ]


def compare_pairs(estimates: Sequence[Estimate]) -> Iterator[AgreementRow]:
    """Compare all pairs of estimates of one bone that differ in a single aspect."""
    for first, second in combinations(estimates, 2):
        if across := first.across(second):
            difference_mm = second.length_mm - first.length_mm
            sd_mm = difference_sd_mm(first, second, across)
            yield {
                "across": across,
                "session": "" if across == "session" else first.session,
                "hand": "" if across == "hand" else first.hand,
                "first": getattr(first, across),
                "second": getattr(second, across),
                "difference_mm": difference_mm,
                "sd_mm": sd_mm,
                "z": difference_mm / sd_mm,
            }


def difference_sd_mm(first: Estimate, second: Estimate, across: str) -> float:
    """Compute the sd of the difference of two estimates of one length (docs/whole-hand.md, section 8).

    The variance is C1 + C2 - 2 sum c1 c2, where c are the pulls of unknowns that both estimates share. These
    are all unknowns within a session, all but those of receiver placement between sessions, and those of
    bones and joints between hands, whose lengths differ by SIDE_SD.

    Parameters
    ----------
    first, second : Estimate
        Estimates of the length.
    across : str
        Aspect in which they differ, one of `ACROSS`.

    Returns
    -------
    float
        Standard deviation, mm.

    """
    shared = sum(
        pull_mm * second.pulls_mm.get((unknown, group), 0.0)
        for (unknown, group), pull_mm in first.pulls_mm.items()
        if across == "recording" or (group in OF_BOTH_HANDS if across == "hand" else group not in PUT_ON)
    )
    side_mm = SIDE_SD * first.length_mm if across == "hand" else 0.0
    return float(np.sqrt(first.sd_mm**2 + second.sd_mm**2 - 2 * shared + side_mm**2))


def times_expected(rows: Iterable[Mapping[str, Any]]) -> dict[str, tuple[float, int]]:
    """Return the root mean square of z (1 if errors are as stated) and the number of pairs, by `across`."""
    by_kind: dict[str, list[float]] = {across: [] for across in ACROSS}
    for row in rows:
        by_kind[row["across"]].append(row["z"])
    return {across: (float(np.sqrt(np.mean(np.square(z)))), len(z)) for across, z in by_kind.items() if z}
