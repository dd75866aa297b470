"""The numbers of movement that are compared, and the columns that say whose each is."""

from __future__ import annotations

from dataclasses import dataclass

from shukotsu.schemas.movement_tables import (
    EVENT_MEASURES,
    FINGERTIP_DISTANCES,
    FINGERTIP_PATHS,
    RANGES_OF_MOTION,
)
from shukotsu.schemas.tables import Table


@dataclass(frozen=True)
class Quantity:
    """What is compared. of : the columns that say whose it is. sd : its 1-sigma error as stated, where it
    can be of what differs between sessions alone. column : that holds it, where its name is not its own.
    """

    table: Table
    name: str
    of: tuple[str, ...]
    sd: str = ""
    joined_by: str = " "
    column: str = ""

    @property
    def columns(self) -> list[str]:
        """Columns of its table that it is read from."""
        units = [column.name for column in self.table.columns if column.name == "unit"]
        return [*self.of, self.column or self.name, *filter(None, [self.sd]), *units]

    @property
    def unit(self) -> str:
        """Unit of its values; empty where every row has its own."""
        return self.table.column(self.column or self.name).unit


ANGLE_OF = ("joint", "angle")
_TIP, _TIPS = ("digit",), ("digit", "other_digit")

QUANTITIES = (
    Quantity(RANGES_OF_MOTION, "range_deg", ANGLE_OF, "range_session_sd_deg"),
    Quantity(RANGES_OF_MOTION, "full_range_deg", ANGLE_OF),
    Quantity(RANGES_OF_MOTION, "median_deg", ANGLE_OF, "median_session_sd_deg"),
    Quantity(RANGES_OF_MOTION, "speed_median_deg_s", ANGLE_OF),
    Quantity(RANGES_OF_MOTION, "speed_p95_deg_s", ANGLE_OF),
    Quantity(FINGERTIP_PATHS, "path_length_mm", _TIP, "path_sd_mm"),
    Quantity(FINGERTIP_PATHS, "speed_median_mm_s", _TIP),
    Quantity(FINGERTIP_PATHS, "speed_p95_mm_s", _TIP),
    Quantity(FINGERTIP_PATHS, "sparc", _TIP),
    Quantity(FINGERTIP_DISTANCES, "min_mm", _TIPS, "distance_sd_mm", "-"),
    Quantity(FINGERTIP_DISTANCES, "median_mm", _TIPS, "distance_sd_mm", "-"),
    Quantity(FINGERTIP_DISTANCES, "contact_percent", _TIPS, "", "-"),
    Quantity(FINGERTIP_DISTANCES, "n_contacts", _TIPS, "", "-"),
    Quantity(EVENT_MEASURES, "event_measure", ("digit", "measure"), "sd", column="value"),
)
