"""Output lists of LIBERTY, PATRIOT and FASTRAK: which items a record holds, and how many bytes they take."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.trackers.protocols.piecewise import rows_at
from shukotsu.trackers.protocols.pose_numbers import fill_in
from shukotsu.trackers.protocols.records import Records, Wholes, empty_records

EXTENDED = "% .6E "
"""A number with an exponent as C writes it; the trackers write a third digit of the exponent."""

CONSTANT_BYTES = {"blank": ord(" "), "cr": ord("\r"), "lf": ord("\n")}
"""Field that never changes -> its byte."""

_WIDEST = {"u4": 10, "i4": 1, "u1": 1}
"""Characters of a whole number."""


@dataclass(frozen=True)
class Item:
    """One item of an output list.

    fields : what its numbers are, in turn; kind : NumPy letter of a number in binary ("f4", "u4", "i4",
    "u1"); text : how all of it is written in ASCII, as a format of C.
    """

    fields: tuple[str, ...]
    kind: str
    text: str

    @property
    def binary_bytes(self) -> int:
        """Bytes in a binary record."""
        return len(self.fields) * int(self.kind[1])

    @property
    def text_bytes(self) -> int:
        """Characters in ASCII, the most where that varies."""
        if "%d" in self.text:
            return len(self.text) - 2 + _WIDEST[self.kind]
        count = self.text.count("%")
        return len(self.text % ((1.0,) * count)) + (count if EXTENDED in self.text else 0)


@dataclass(frozen=True)
class OutputItems:
    """The items of a family, and the limits of its output lists.

    header : name and NumPy type of the fields that a binary record begins with, `station` and `error` among
    them; text_header_bytes : characters before the first number in ASCII; full, short : the lists that a
    recorder asks for, all that is of use and only what must be. decodable : list and mode -> the list with
    the blanks and line ends that decoding needs.
    """

    family: str
    items: Mapping[int, Item]
    stations: range
    max_items: int
    max_record_bytes: int
    header: tuple[tuple[str, str], ...]
    text_header_bytes: int
    full: tuple[int, ...]
    short: tuple[int, ...]
    decodable: Callable[[tuple[int, ...], str], tuple[int, ...]]

    @property
    def header_bytes(self) -> int:
        """Bytes of a binary record before its first item."""
        return np.dtype(list(self.header)).itemsize

    def record_bytes(self, items: Sequence[int], mode: str = "binary") -> int:
        """Bytes of a whole record, header and all; in ASCII the most that it can be."""
        if mode == "binary":
            return self.header_bytes + sum(self.items[item].binary_bytes for item in items)
        return self.text_header_bytes + sum(self.items[item].text_bytes for item in items)

    def one_list(self, lists: Mapping[int, Sequence[int]]) -> tuple[int, ...]:
        """Give the output list that all stations have; lists : station -> its list.

        Raises InputError where there is no such station or item, or the lists differ.
        """
        for station, items in lists.items():
            if station not in self.stations or not items or not self.items.keys() >= set(items):
                raise InputError(
                    f"settings of the tracker: output list {list(items)} of station {station}; a "
                    f"{self.family} has stations 1 to {self.stations[-1]} and items "
                    f"{', '.join(map(str, self.items))}; correct its output lists"
                )
        several = {tuple(items) for items in lists.values()}
        if len(several) != 1:
            raise InputError(
                f"settings of the tracker: has {len(several)} output lists; expected one for all stations"
            )
        return several.pop()

    def record_type(self, items: Sequence[int]) -> np.dtype[np.void]:
        """NumPy type of a whole binary record; an item that is given twice keeps its first numbers."""
        fields, names = list(self.header), {name for name, _ in self.header}
        for place, item in enumerate(items):
            for name in self.items[item].fields:
                fields.append((f"{name}_{place}" if name in names else name, f"<{self.items[item].kind}"))
                names.add(name)
        return np.dtype(fields)


def read_binary_records(
    b: npt.NDArray[np.uint8], at: Wholes, kind: np.dtype[np.void], mm_per_unit: float
) -> Records:
    """Read N records of one type that start at bytes `at` of `b`; `station` is the byte as sent.

    Nothing is checked but what cannot be right: see `Records.doubtful`.
    """
    size = kind.itemsize
    records = empty_records(len(at))
    if not len(at):
        return records
    rows = rows_at(b, at, size).view(kind)[:, 0]
    records.offset[:] = at
    records.size[:] = size
    records.station[:] = rows["station"]
    records.error[:] = np.where(rows["error"] == ord(" "), 0, rows["error"])
    numbers = {name: rows[name] for name in kind.names or ()}
    if "button" in numbers and numbers["button"].dtype == np.uint8:
        numbers["button"] = numbers["button"] & 1  # the character '0' or '1'
    fill_in(records, numbers, mm_per_unit)
    return records
