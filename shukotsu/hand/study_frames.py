"""All tables of a study for notebooks: by name, over all subjects, with the study's factors as columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.errors import InputError, TableError, guess
from shukotsu.hand.read_results import read_file
from shukotsu.study.plan_file import read_plan
from shukotsu.study.results import FIT_TABLES, SUBJECT_TABLES
from shukotsu.tables.catalogue import TABLES

if TYPE_CHECKING:
    import pandas as pd

WHOSE = ["subject", "session"]
WHICH = [*WHOSE, "hand", "task", "trial"]


class StudyTables(Mapping[str, "pd.DataFrame"]):
    """A study's tables by name, each read on access.

    A table has the rows of all subjects and a column for each of the study's factors. Rows of skeletons that
    were made without a task are left out. Files that could not be made are in `attrs["left_out"]`, with the
    reason.
    """

    def __init__(self, folder: Path) -> None:
        plans = [read_plan(path) for path in sorted(folder.glob("sub-*/plan.json"))]
        if not plans:
            raise InputError(f"{folder}: has no results of a study; expected a folder such as results/demo")
        self.folder = folder
        self._people = [plan.who._asdict() | dict(plan.factors) for plan in plans]
        self._recordings = [
            recording.key | dict(plan.factors) | dict(recording.factors)
            for plan in plans
            for recording in plan.recordings
        ]

    def __iter__(self) -> Iterator[str]:
        return (name for name in TABLES if self._files(name))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def __getitem__(self, name: str) -> pd.DataFrame:
        import pandas as pd

        files = self._files(name) if name in TABLES else []
        if not files:
            raise InputError(f"{self.folder}: has no table {name!r}; {guess(name, list(self))}")
        frames, left_out = [], {}
        for path in files:
            try:
                frames.append(read_file(path))
            except TableError:
                raise
            except InputError as error:
                left_out[str(path)] = error.message
        if not frames:
            raise InputError(next(iter(left_out.values())))
        frame = pd.concat([each for each in frames if len(each)] or frames[:1], ignore_index=True)
        if "made_without" in frame:
            frame = frame[frame["made_without"] == ""].reset_index(drop=True)
        attributes = frames[0].attrs | {"left_out": left_out}
        on, rows = (WHICH, self._recordings) if set(WHICH) <= set(frame) else (WHOSE, self._people)
        if set(on) <= set(frame):
            levels = pd.DataFrame(rows).drop_duplicates(on)
            new = [column for column in levels if column in on or column not in frame]
            frame = frame.merge(levels[new], how="left", on=on)
        frame.attrs = attributes
        return frame

    def _files(self, name: str) -> list[Path]:
        """Return the files of a table: the study-wide one if it exists, otherwise those of all subjects."""
        if (whole := self.folder / f"{name}.parquet").is_file():
            return [whole]
        if name in FIT_TABLES:
            return sorted(self.folder.glob(f"sub-*/fits/*/*/{name}.parquet"))
        return sorted(self.folder.glob(f"sub-*/{name}.parquet")) if name in SUBJECT_TABLES else []


def read(path: str | Path) -> Any:
    """Read a study's results: one table, or all tables of a study by name.

    Parameters
    ----------
    path : str or Path
        Any table of a study, or the study's folder, such as results/demo; it may have been moved.

    Returns
    -------
    pandas.DataFrame or StudyTables
        For a file, the table, with gaps as pandas' missing values; `attrs` has `table` (its name), `key` (the
        columns that identify a row), `units` and `descriptions` by column. For a folder, such tables by name.

    Raises
    ------
    InputError
        If the file or study does not exist, or the file is not a table of this program.

    """
    return StudyTables(Path(path)) if Path(path).is_dir() else read_file(Path(path))
