"""Pairs of a factor's levels: whether the same subjects have both, and who is left out and why."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from shukotsu.errors import listed
from shukotsu.stages.compare_movement.movement_values import Recorded, in_order

if TYPE_CHECKING:
    import pandas as pd

WITHIN, BETWEEN = "within", "between"
MOST_LEVELS = 8
"""A factor with more levels than this is a measured quantity, and is not compared pair by pair."""


@dataclass(frozen=True)
class LevelPair:
    """Two levels of a factor in one place (a hand and a task, less the factor itself).

    levels_of : each subject's levels among the two, recordings that count or not. in_part : subjects of whom
    some recordings do not count, by the reason. wholly : those of whom none does. without : subjects who were
    recorded there and have no level.
    """

    factor: str
    level: str
    other: str
    levels_of: Mapping[str, frozenset[str]]
    in_part: Mapping[str, str]
    wholly: Mapping[str, str]
    without: Sequence[str] = ()

    @property
    def design(self) -> str:
        """Within where at least as many subjects have both levels as have one, else between."""
        n_both = sum(len(levels) == 2 for levels in self.levels_of.values())
        return WITHIN if 2 * n_both >= len(self.levels_of) else BETWEEN

    def candidates(self, level: str) -> frozenset[str]:
        """Subjects that may stand for the level: within those with both, between those with it alone."""
        wanted = {self.level, self.other} if self.design == WITHIN else {level}
        return frozenset(subject for subject, levels in self.levels_of.items() if levels == wanted)

    def left_out(self, used: Collection[str]) -> tuple[int, str]:
        """Count the subjects not in `used`, and say why they, or some recordings of others, are not."""
        missing = [subject for subject in self.levels_of if subject not in used]
        reasons: dict[str, list[str]] = defaultdict(list)
        for subject in missing:
            reasons[self._reason(subject)].append(subject)
        for subject, reason in self.in_part.items():
            if subject in used:
                reasons[f"{reason} in part"].append(subject)
        if self.without:
            reasons[f"no level of {self.factor}"] += self.without
        text = "; ".join(f"{reason}: {listed(subjects)}" for reason, subjects in reasons.items())
        return len(missing) + len(self.without), text

    def _reason(self, subject: str) -> str:
        levels = self.levels_of[subject]
        if subject in self.wholly:
            return self.wholly[subject]
        if self.design == WITHIN and len(levels) == 1:
            return f"only at {next(iter(levels))}"
        if self.design == BETWEEN and len(levels) == 2:
            return "at both levels"
        return f"{self.in_part[subject]} in part" if subject in self.in_part else "no value"


def level_pairs(everything: Recorded, factor: str, place: Mapping[str, str]) -> Iterator[LevelPair]:
    """Pairs of the factor's levels in a place, in the sheet's order; none of a factor with too many."""
    rows = everything.rows
    for column, value in place.items():
        rows = rows[rows[column] == value]
    recorded = rows["subject"]
    rows = rows[rows[factor] != ""]
    having = set(rows["subject"])
    without = [subject for subject in dict.fromkeys(recorded) if subject not in having]
    levels = in_order(rows, factor)
    if len(levels) > MOST_LEVELS:
        return
    for level, other in combinations(levels, 2):
        yield _pair(rows[rows[factor].isin([level, other])], factor, level, other, without)


def _pair(rows: pd.DataFrame, factor: str, level: str, other: str, without: Sequence[str]) -> LevelPair:
    levels_of = {str(subject): frozenset(own) for subject, own in rows.groupby("subject", sort=False)[factor]}
    in_part: dict[str, str] = {}
    wholly: dict[str, str] = {}
    for subject, reasons in rows.groupby("subject", sort=False)["left_out"]:
        dropped = [reason for reason in reasons if reason]
        if dropped:
            (wholly if len(dropped) == len(reasons) else in_part)[str(subject)] = dropped[0]
    return LevelPair(factor, level, other, levels_of, in_part, wholly, without)


def places(everything: Recorded, factor: str) -> Iterator[dict[str, str]]:
    """Every hand and task of the study, less the one that is the factor."""
    columns = [column for column in ("hand", "task") if column != factor]
    for key in everything.rows[columns].drop_duplicates().itertuples(index=False, name=None):
        yield dict(zip(columns, key, strict=True))
