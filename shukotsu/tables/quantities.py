"""The numbers of movement that are compared, and the columns that say whose each is."""

from __future__ import annotations

from dataclasses import dataclass

from shukotsu.tables.catalogue import FINGERTIP_PATHS, RANGES_OF_MOTION
from shukotsu.tables.typed_table import Table


@dataclass(frozen=True)
class Quantity:
    """A column of a table that is compared. of : the columns that say whose it is."""

    table: Table
    name: str
    of: tuple[str, ...]

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return self.table.column(self.name).unit


QUANTITIES = (
    *(
        Quantity(RANGES_OF_MOTION, name, ("joint", "angle"))
        for name in ("range_deg", "full_range_deg", "median_deg", "speed_median_deg_s", "speed_p95_deg_s")
    ),
    *(
        Quantity(FINGERTIP_PATHS, name, ("digit",))
        for name in ("path_length_mm", "speed_median_mm_s", "speed_p95_mm_s")
    ),
)
