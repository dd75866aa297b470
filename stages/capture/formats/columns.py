"""A file's columns by name: what the tidy reader asks of a format."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError

_LARGEST_EXACT = 2.0**53
"""Beyond this a floating-point number no longer tells one whole number from the next."""


class Columns(ABC):
    """N rows; every method raises InputError that names the row of the first bad cell."""

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """The columns that there are."""

    @property
    @abstractmethod
    def rows(self) -> int:
        """How many rows there are."""

    @abstractmethod
    def reals(self, name: str) -> npt.NDArray[np.float64]:
        """Numbers, shape (N,); NaN where the cell is empty."""

    @abstractmethod
    def integers(self, name: str) -> npt.NDArray[np.int64] | None:
        """Numbers that all are written as integers, shape (N,); None where any is not, or is empty."""

    @abstractmethod
    def words(self, name: str) -> tuple[npt.NDArray[np.int64], list[str]]:
        """Text as (N,) indices into a list of words; an empty cell is refused."""

    @abstractmethod
    def cell(self, name: str, row: int) -> object:
        """What stands in a cell; None where it is empty."""

    @abstractmethod
    def place(self, row: int) -> str:
        """File and row (counted from 0) in words, as the person who opens the file counts."""

    def wholes(self, name: str) -> npt.NDArray[np.int64]:
        """Whole numbers, shape (N,), 3.0 among them; an empty cell is refused."""
        integers = self.integers(name)
        if integers is not None:
            return integers
        reals = self.reals(name)
        self.refuse_first(
            ~((np.abs(reals) <= _LARGEST_EXACT) & (reals == np.floor(reals))), name, "a whole number"
        )
        return reals.astype(np.int64)

    def refuse_first(self, bad: npt.NDArray[np.bool_], name: str, expected: str) -> None:
        """Raise InputError that names the first bad cell of a column, if there is one; bad : (N,)."""
        if bad.any():
            row = int(np.argmax(bad))
            found = self.cell(name, row)
            what = "is empty" if found is None else f"is {found!r}"
            raise InputError(f"{self.place(row)}, column {name}: {what}; expected {expected}")
