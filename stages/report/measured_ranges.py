"""The ranges of motion of one subject's recordings, as the movement tables have them: for its own pages."""

from __future__ import annotations

from shukotsu.errors import InputError
from shukotsu.schemas.catalogue import RANGES_OF_MOTION
from shukotsu.schemas.parts import Part, read_part
from shukotsu.schemas.study import Hand
from shukotsu.schemas.tables import rows_of
from shukotsu.sentences.translation import tr
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.table_cells import (
    Column,
    DataTable,
    number,
    number_column,
    quantity_column,
    table_of,
    text_column,
)


def measured_ranges(results: StudyResults, hand: Hand, model: str) -> list[Row]:
    """Rows of ranges_of_motion of a hand under a model; none where movement was not measured."""
    path = results.subject_table(hand, RANGES_OF_MOTION.name)
    if not path.is_file():
        return []
    part = Part(hand.hand, model, "", hand.subject, hand.session)
    columns = [column.name for column in RANGES_OF_MOTION.columns]
    try:
        return list(rows_of(read_part(path, RANGES_OF_MOTION, part, columns)))
    except InputError:
        return []


def measured_table(caption: str, rows: list[Row], *, with_recording: bool) -> DataTable:
    """Range, posture and speed of every joint angle, each range with its stated 1-sigma error."""
    task = Column(tr("Task"), lambda r: ", trial ".join(filter(None, (r["task"], r["trial"]))), is_text=True)
    columns = (
        text_column(tr("Joint"), "joint"),
        text_column(tr("Angle"), "angle"),
        *((task,) if with_recording else ()),
        Column(tr("Range of motion [deg]"), lambda row: _with_sd(row, "range")),
        number_column(tr("2.5 % [deg]"), "low_deg", 1),
        number_column(tr("97.5 % [deg]"), "high_deg", 1),
        number_column(tr("Full range [deg]"), "full_range_deg", 1),
        Column(tr("Median [deg]"), lambda row: _with_sd(row, "median")),
        number_column(tr("Speed, median [deg/s]"), "speed_median_deg_s", 1),
        quantity_column("speed_p95_deg_s"),
        quantity_column("valid_percent"),
    )
    return table_of(caption, columns, rows)


def _with_sd(row: Row, name: str) -> str:
    value, sd = row[f"{name}_deg"], row[f"{name}_sd_deg"]
    return number(value, 1) + ("" if value is None or sd is None else f" ± {number(sd, 1)}")
