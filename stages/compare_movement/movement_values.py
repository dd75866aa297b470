"""The numbers that subjects are compared by: of recordings that count, one for each subject and level.

A value is averaged over trials first and over sessions then, so that who was recorded more often does not
count more often. Recordings of a hand with a suspect finding are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.schemas.movement_tables import FINGERTIP_DISTANCES, FINGERTIP_PATHS, RANGES_OF_MOTION
from shukotsu.schemas.tables import Table, open_table

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

RECORDING = ["subject", "session", "hand", "task", "trial"]
SUSPECT = "suspect"


@dataclass(frozen=True)
class Quantity:
    """A column that is compared. of : the columns that say whose it is. sd : its 1-sigma error
    as stated, where it can be of what differs between sessions alone.
    """

    table: Table
    name: str
    of: tuple[str, ...]
    sd: str = ""
    joined_by: str = ""

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return self.table.column(self.name).unit


_ANGLE, _TIP, _TIPS = ("joint", "angle"), ("digit",), ("digit", "other_digit")

QUANTITIES = (
    Quantity(RANGES_OF_MOTION, "range_deg", _ANGLE, "range_session_sd_deg", " "),
    Quantity(RANGES_OF_MOTION, "full_range_deg", _ANGLE, "", " "),
    Quantity(RANGES_OF_MOTION, "median_deg", _ANGLE, "median_session_sd_deg", " "),
    Quantity(RANGES_OF_MOTION, "speed_median_deg_s", _ANGLE, "", " "),
    Quantity(RANGES_OF_MOTION, "speed_p95_deg_s", _ANGLE, "", " "),
    Quantity(FINGERTIP_PATHS, "path_length_mm", _TIP, "path_sd_mm"),
    Quantity(FINGERTIP_PATHS, "speed_median_mm_s", _TIP),
    Quantity(FINGERTIP_PATHS, "speed_p95_mm_s", _TIP),
    Quantity(FINGERTIP_PATHS, "sparc", _TIP),
    Quantity(FINGERTIP_DISTANCES, "min_mm", _TIPS, "distance_sd_mm", "-"),
    Quantity(FINGERTIP_DISTANCES, "median_mm", _TIPS, "distance_sd_mm", "-"),
    Quantity(FINGERTIP_DISTANCES, "contact_percent", _TIPS, "", "-"),
    Quantity(FINGERTIP_DISTANCES, "n_contacts", _TIPS, "", "-"),
)


@dataclass(frozen=True)
class Recorded:
    """The study's recordings with their levels.

    rows : RECORDING, a column a factor (empty where a recording has no level), and `left_out`: why a
    recording is in no statistic, empty where it counts. factors : names of the columns.
    """

    rows: pd.DataFrame
    factors: tuple[str, ...]

    @property
    def counted(self) -> pd.DataFrame:
        """The recordings that count."""
        return self.rows[self.rows["left_out"] == ""]


def recorded(levels: pd.DataFrame, factors: Sequence[str], problems: pd.DataFrame) -> Recorded:
    """Mark in the recordings with their levels those of hands that a problem calls suspect.

    levels : RECORDING and a column a factor. problems : as the table has them.
    """
    hand = ["subject", "session", "hand"]
    suspect = set(problems.loc[problems["severity"] == SUSPECT, hand].itertuples(index=False, name=None))
    reasons = [SUSPECT if key in suspect else "" for key in levels[hand].itertuples(index=False, name=None)]
    return Recorded(levels.assign(left_out=reasons), tuple(factors))


def read_frame(path: Path, table: Table, columns: Sequence[str]) -> pd.DataFrame:
    """Read columns of a table, text as categories: a long table has few names many times."""
    import pyarrow as pa

    with open_table(path, table) as file:
        batches = file.iter_batches(columns=list(columns))
        parts = [_with_categories(pa.Table.from_batches([batch])) for batch in batches]
        empty = file.schema_arrow.empty_table().select(list(columns))
    whole = pa.concat_tables([_with_categories(empty), *parts]).unify_dictionaries()
    frame: pd.DataFrame = whole.to_pandas()
    return frame


def _with_categories(part: pa.Table) -> pa.Table:
    import pyarrow as pa

    for place, field in enumerate(part.schema):
        if pa.types.is_string(field.type):
            part = part.set_column(place, field.name, part.column(place).dictionary_encode())
    return part.replace_schema_metadata()


def numbers_of(quantity: Quantity, whole: pd.DataFrame, counted: pd.DataFrame) -> pd.DataFrame:
    """A quantity's numbers in the recordings that count: those' columns, model, of, value and sd.

    whole : the quantity's table. Rows without a number are left out; sd is NaN where none is stated. Sessions
    come one after the other, see `in_order`, and so do the trials of each.
    """
    of = whole[quantity.of[0]].astype(str)
    for other in quantity.of[1:]:
        of = of + quantity.joined_by + whole[other].astype(str)
    named = whole[[*RECORDING, "model"]].astype(str)
    numbers = named.assign(
        of=of,
        value=whole[quantity.name].astype(float),
        sd=whole[quantity.sd].astype(float) if quantity.sd else float("nan"),
    )
    found = numbers.dropna(subset="value").merge(counted, on=RECORDING)
    for column in ("trial", "session"):
        order = {name: place for place, name in enumerate(in_order(counted, column))}
        found = found.sort_values(column, key=lambda names, order=order: names.map(order), kind="stable")
    return found.reset_index(drop=True)


def in_order(rows: pd.DataFrame, column: str) -> list[str]:
    """List what a column of recordings has, in the order of the sheet: of the subjects who have most of it
    first.

    A subject whose second session is missing does not put the third before it.
    """
    own = rows.groupby("subject", sort=False)[column].unique()
    most = own[own.map(len).sort_values(ascending=False, kind="stable").index]
    return list(dict.fromkeys(str(name) for names in most for name in names))


def subject_means(
    frame: pd.DataFrame, factor: str, cell: Sequence[str], value: Sequence[str] = ("value",)
) -> pd.DataFrame:
    """Means over trials, then over sessions: rows by the columns of `cell`, subject and level."""
    levels = frame.assign(level=frame[factor])
    levels = levels[levels["level"] != ""]
    whose = [*cell, "subject", "session", "level"]
    by_session = levels.groupby(whose, sort=False, observed=True)[list(value)].mean()
    by_subject = by_session.groupby([*cell, "subject", "level"], sort=False, observed=True)
    means: pd.DataFrame = by_subject.mean()
    return means
