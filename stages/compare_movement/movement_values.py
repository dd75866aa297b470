"""The numbers that subjects are compared by: of recordings that count, one for each subject and level.

A value is averaged over trials first and over sessions then, so that who was recorded more often does not
count more often. Recordings of a hand with a suspect finding are left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from shukotsu.schemas.quantities import Quantity
from shukotsu.schemas.study import OWN_FACTORS

if TYPE_CHECKING:
    import pandas as pd

RECORDING = ["subject", "session", "hand", "task", "trial"]
SUSPECT = "suspect"
SESSION, TRIAL = "session", "trial"


@dataclass(frozen=True)
class Recorded:
    """The study's recordings with their levels.

    rows : RECORDING, a column a factor (`level_column`; empty where a recording has no level), and
    `left_out`: why a recording is in no statistic, empty where it counts. factors : those that are compared.
    """

    rows: pd.DataFrame
    factors: tuple[str, ...]

    @property
    def counted(self) -> pd.DataFrame:
        """The recordings that count."""
        return self.rows[self.rows["left_out"] == ""]

    @cached_property
    def contained(self) -> dict[str, dict[tuple[str, str], str]]:
        """Factors of which a subject has other levels in another, by session and trial, then hand and task.

        What such a factor does is in the numbers' change, which then is no measurement error alone.
        """
        recordings = self.rows
        if SESSION in self.factors:
            recordings = recordings.assign(**{level_column("") + SESSION: recordings[SESSION]})
        names = [name for name in recordings if name.startswith(level_column(""))]
        changing: dict[str, dict[tuple[str, str], str]] = {SESSION: {}, TRIAL: {}}
        for across, whose in ((SESSION, ["subject"]), (TRIAL, ["subject", SESSION])) if names else ():
            for (hand, task), rows in recordings.groupby(["hand", "task"], sort=False):
                levels = rows.groupby([*whose, across], sort=False)[names].agg(frozenset)
                n = levels.groupby(whose, sort=False).nunique()
                changed = n.columns[(n > 1).any()].str.removeprefix(level_column(""))
                changing[across][str(hand), str(task)] = ";".join(changed)
        return changing


def level_column(factor: str) -> str:
    """Return the column of a factor's levels: a sheet's column may be called as any column of a table."""
    return factor if factor in OWN_FACTORS else f"level of {factor}"


def recorded(rows: Sequence[Mapping[str, str]], factors: Collection[str], problems: pd.DataFrame) -> Recorded:
    """Mark in the recordings with their levels those of hands that a problem calls suspect.

    rows : as `factor_levels` returns them. problems : as the table has them.
    """
    import pandas as pd

    names = [*RECORDING, *factors]
    levels = pd.DataFrame(rows, columns=list(dict.fromkeys(names)), dtype=str)
    levels = levels.rename(columns={name: level_column(name) for name in names if name not in RECORDING})
    hand = ["subject", "session", "hand"]
    suspect = set(problems.loc[problems["severity"] == SUSPECT, hand].itertuples(index=False, name=None))
    reasons = [SUSPECT if key in suspect else "" for key in levels[hand].itertuples(index=False, name=None)]
    return Recorded(levels.assign(left_out=reasons), tuple(factors))


def numbers_of(quantity: Quantity, whole: pd.DataFrame, counted: pd.DataFrame) -> pd.DataFrame:
    """A quantity's numbers in the recordings that count: those' columns, model, of and value.

    whole : the quantity's table. Sessions come one after the other, see `in_order`, and so do the trials of
    each.
    """
    first, *others = quantity.of
    of = whole[first].str.cat([whole[name] for name in others], sep=" ") if others else whole[first]
    numbers = whole[[*RECORDING, "model"]].assign(of=of, value=whole[quantity.name].astype(float))
    numbers = numbers.dropna(subset="value").merge(counted, on=RECORDING)
    for column in ("trial", "session"):
        order = {name: rank for rank, name in enumerate(in_order(counted, column))}
        numbers = numbers.sort_values(column, key=lambda names, order=order: names.map(order), kind="stable")
    return numbers.reset_index(drop=True)


def in_order(rows: pd.DataFrame, column: str) -> list[str]:
    """Return what a column of recordings has, in the order of the sheet: of the subjects who have most of it
    first.

    A subject whose second session is missing does not put the third before it.
    """
    levels = rows.groupby("subject", sort=False)[column].unique()
    most = levels[levels.map(len).sort_values(ascending=False, kind="stable").index]
    return list(dict.fromkeys(str(name) for names in most for name in names))


def subject_means(numbers: pd.DataFrame, factor: str, cell: Sequence[str]) -> pd.Series[float]:
    """Means over trials, then over sessions: by the columns of `cell`, subject and level."""
    levels = numbers.assign(level=numbers[level_column(factor)])
    levels = levels[levels["level"] != ""]
    by_session = levels.groupby([*cell, "subject", "session", "level"], sort=False)["value"].mean()
    means: pd.Series[float] = by_session.groupby([*cell, "subject", "level"], sort=False).mean()
    return means
