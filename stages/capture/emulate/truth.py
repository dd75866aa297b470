"""What the emulator did, cycle by cycle and byte by byte: the log that a client is checked against."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import InputError
from schemas.files import replacing
from stages.capture.emulate.device import Cycle
from stages.capture.emulate.faults import Edit

if TYPE_CHECKING:
    import pyarrow as pa

ENDINGS = (".parquet", ".csv")
SENT, LOST, CUT = "sent", "lost", "cut"
KINDS = (SENT, LOST, CUT, "drop", "flip", "duplicate", "garbage")
COLUMNS = {
    "cycle": "the device's cycle since power-up",
    "host_ns": "the host's monotonic clock when the cycle was due",
    "frame": "the frame count in its records",
    "device_ms": "the timestamp in its records",
    "offset": "where it stands in the stream: bytes that the device had put out before it",
    "size": "sent, lost, cut: bytes; drop, flip: bytes taken away; duplicate, garbage: bytes put in",
    "stations": "bit mask of the stations that sent a record",
    "value": "drop, flip, duplicate: the byte as it was; otherwise -1",
}


class Truth:
    """The log in memory; `write` makes the file."""

    def __init__(self) -> None:
        self._kinds = array("b")
        self._columns = {name: array("q") for name in COLUMNS}

    def cycle(self, kind: str, cycle: Cycle, host_ns: int, offset: int, size: int) -> None:
        """Keep that a cycle was sent, lost whole because there was no room, or cut as the device went."""
        self._add(kind, cycle, host_ns, offset, size, -1)

    def edit(self, edit: Edit, cycle: Cycle, host_ns: int, offset: int) -> None:
        """Keep what happened to bytes of a cycle; offset is where in the stream."""
        value = cycle.data[edit.position] if edit.kind in ("drop", "flip", "duplicate") else -1
        self._add(edit.kind, cycle, host_ns, offset, edit.removed or len(edit.inserted), value)

    def _add(self, kind: str, cycle: Cycle, host_ns: int, offset: int, size: int, value: int) -> None:
        stations = sum(1 << (station - 1) for station in cycle.stations)
        values = (cycle.number, host_ns, cycle.frame, cycle.device_ms, offset, size, stations, value)
        self._kinds.append(KINDS.index(kind))
        for column, number in zip(self._columns.values(), values, strict=True):
            column.append(number)

    def table(self) -> pa.Table:
        """Give the log as a table: `kind` and COLUMNS."""
        import pyarrow as pa

        kinds = pa.array([KINDS[number] for number in self._kinds], pa.string())
        numbers = {name: pa.array(column, pa.int64()) for name, column in self._columns.items()}
        table = pa.table({"kind": kinds, **numbers})
        texts = {"kind": "what happened", **COLUMNS}
        return table.cast(
            pa.schema([field.with_metadata({"description": texts[field.name]}) for field in table.schema])
        )

    def write(self, path: Path) -> None:
        """Write the log as Parquet or CSV, by the file's ending."""
        import pyarrow.csv
        import pyarrow.parquet as pq

        with replacing(path) as temporary:
            if path.suffix == ".csv":
                pyarrow.csv.write_csv(self.table(), temporary)
            else:
                pq.write_table(self.table(), temporary, compression="zstd")


def check_ending(path: Path) -> None:
    """Raise InputError unless the file's name says a format that can be written."""
    if path.suffix not in ENDINGS:
        raise InputError(f"{path}: the ending says the format; expected {' or '.join(ENDINGS)}")
