"""Pairs of a factor's levels: whether the same subjects have both, and who is left out and why."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from shukotsu.errors import listed
from shukotsu.stages.compare_movement.movement_values import SUSPECT, Recorded, in_order, level_column

if TYPE_CHECKING:
    import pandas as pd

WITHIN, BETWEEN = "within", "between"


@dataclass(frozen=True)
class LevelPair:
    """Two levels of a factor in one place: a hand and a task, less the factor itself.

    design : within where at least as many of the study's subjects have both levels as have one, else between.
    levels_of : each subject's levels among the two, recordings that count or not; between groups those that
    they have in any place. suspect : subjects of whom some recordings do not count, or none does, in these
    words. without : subjects who were recorded there and have no level.
    """

    factor: str
    place: Mapping[str, str]
    level: str
    other: str
    design: str
    levels_of: Mapping[str, frozenset[str]]
    suspect: Mapping[str, str]
    without: Sequence[str]

    def candidates(self, level: str) -> frozenset[str]:
        """Subjects that may stand for the level: within those with both, between those with it alone."""
        wanted = {self.level, self.other} if self.design == WITHIN else {level}
        return frozenset(subject for subject, levels in self.levels_of.items() if levels == wanted)

    def left_out(self, used: Collection[str]) -> tuple[int, str]:
        """Count the subjects not in `used`, and say why they, or some recordings of others, are not."""
        reasons: dict[str, list[str]] = {}
        for subject in sorted(self.levels_of, key=lambda name: name in used):
            levels, reason = self.levels_of[subject], self.suspect.get(subject, "")
            if subject not in used and reason != SUSPECT:
                if self.design == WITHIN and len(levels) == 1:
                    reason = f"only at {next(iter(levels))}"
                elif self.design == BETWEEN and len(levels) == 2:
                    reason = "at both levels"
                reason = reason or "no value"
            if reason:
                reasons.setdefault(reason, []).append(subject)
        if self.without:
            reasons[f"no level of {self.factor}"] = list(self.without)
        text = "; ".join(f"{reason}: {listed(subjects)}" for reason, subjects in reasons.items())
        return sum(name not in used for name in self.levels_of) + len(self.without), text


def level_pairs(everything: Recorded) -> Iterator[LevelPair]:
    """Pairs of every factor's levels, in every hand and task of the study, less the one that is the factor.

    Levels stand in the sheet's order, which is one for all places.
    """
    for factor in everything.factors:
        column = level_column(factor)
        study = everything.rows[everything.rows[column] != ""]
        order = in_order(study, column)
        names = [name for name in ("hand", "task") if name != factor]
        for place, in_place in everything.rows.groupby(names, sort=False):
            here = in_place[in_place[column] != ""]
            without = in_place.loc[~in_place["subject"].isin(here["subject"]), "subject"].unique().tolist()
            for levels in combinations([level for level in order if level in {*here[column]}], 2):
                rows = here[here[column].isin(levels)]
                anywhere = _levels_of(study[study[column].isin(levels)], column)
                both = sum(len(own) == 2 for own in anywhere.values())
                design = WITHIN if 2 * both >= len(anywhere) else BETWEEN
                levels_of = _levels_of(rows, column)
                if design == BETWEEN:
                    levels_of = {subject: anywhere[subject] for subject in levels_of}
                share = (rows["left_out"] != "").groupby(rows["subject"], sort=False).mean()
                suspect = {str(name): SUSPECT + " in part" * (of < 1) for name, of in share.items() if of > 0}
                where = {str(name): str(value) for name, value in zip(names, place, strict=True)}
                yield LevelPair(factor, where, *levels, design, levels_of, suspect, without)


def _levels_of(rows: pd.DataFrame, column: str) -> dict[str, frozenset[str]]:
    return {str(subject): frozenset(own) for subject, own in rows.groupby("subject", sort=False)[column]}
