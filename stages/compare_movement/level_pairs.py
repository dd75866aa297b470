"""Pairs of a factor's levels: whether the same subjects have both, and who is left out and why."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from shukotsu.errors import listed
from shukotsu.stages.compare_movement.movement_values import Recorded, in_order, level_column

if TYPE_CHECKING:
    import pandas as pd

WITHIN, BETWEEN = "within", "between"


@dataclass(frozen=True)
class LevelPair:
    """Two levels of a factor in one place (a hand and a task, less the factor itself).

    design : within where at least as many of the study's subjects have both levels as have one, else between.
    levels_of : each subject's levels among the two, recordings that count or not; between groups those that
    they have in any place. in_part : subjects of whom some recordings do not count, by the reason. wholly :
    those of whom none does. without : subjects who were recorded there and have no level.
    """

    factor: str
    level: str
    other: str
    design: str
    levels_of: Mapping[str, frozenset[str]]
    in_part: Mapping[str, str]
    wholly: Mapping[str, str]
    without: Sequence[str] = ()

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
    """Pairs of the factor's levels in a place, in the sheet's order, which is one for all places."""
    column, study = level_column(factor), everything.rows
    in_place = study
    for name, value in place.items():
        in_place = in_place[in_place[name] == value]
    here, study = in_place[in_place[column] != ""], study[study[column] != ""]
    missing = dict.fromkeys(in_place["subject"])
    without = [subject for subject in missing if subject not in set(here["subject"])]
    present = set(here[column])
    for levels in combinations([level for level in in_order(study, column) if level in present], 2):
        rows = here[here[column].isin(levels)]
        yield _level_pair(factor, levels, rows, study[study[column].isin(levels)], without)


def _level_pair(
    factor: str, levels: tuple[str, str], rows: pd.DataFrame, study: pd.DataFrame, without: Sequence[str]
) -> LevelPair:
    """Two levels, of the recordings in a place and in the whole study that have either."""
    column = level_column(factor)
    anywhere, levels_of = _levels_of(study, column), _levels_of(rows, column)
    n_both = sum(len(own) == 2 for own in anywhere.values())
    design = WITHIN if 2 * n_both >= len(anywhere) else BETWEEN
    if design == BETWEEN:
        levels_of = {subject: anywhere[subject] for subject in levels_of}
    in_part: dict[str, str] = {}
    wholly: dict[str, str] = {}
    for subject, reasons in rows.groupby("subject", sort=False)["left_out"]:
        dropped = [reason for reason in reasons if reason]
        if dropped:
            (wholly if len(dropped) == len(reasons) else in_part)[str(subject)] = dropped[0]
    return LevelPair(factor, *levels, design, levels_of, in_part, wholly, without)


def _levels_of(rows: pd.DataFrame, column: str) -> dict[str, frozenset[str]]:
    return {str(subject): frozenset(own) for subject, own in rows.groupby("subject", sort=False)[column]}


def places(everything: Recorded, factor: str) -> Iterator[dict[str, str]]:
    """Every hand and task of the study, less the one that is the factor."""
    columns = [column for column in ("hand", "task") if column != factor]
    for key in everything.rows[columns].drop_duplicates().itertuples(index=False, name=None):
        yield dict(zip(columns, key, strict=True))
