"""The recording's tables: tip errors, ranges of motion, and what the data say of each joint."""

from __future__ import annotations

from collections.abc import Iterable

from stages.report.data_table import DASH, Block, DataTable, number
from stages.report.recording.angles import AngleRange
from stages.report.recording.reading import ModelResults, Row
from stages.report.skeleton_tables import STATUS_MARKS


def tip_error_table(caption: str, models: Iterable[ModelResults]) -> DataTable:
    """The recording's rows of tip_errors, mm: the replay under every model, both bindings."""
    header = (
        "Model",
        "Digit",
        "Binding",
        "Mean [mm]",
        "SD [mm]",
        "Median [mm]",
        "95 % [mm]",
        "Max [mm]",
        "Min [mm]",
        "Frames",
        "Of",
        "Held out",
        "Message",
    )
    rows = tuple(_tip_error_cells(row) for model in models for row in model.tip_errors)
    return DataTable(caption, (Block(header, rows),), (), frozenset({0, 1, 2, 11, 12}))


def range_table(caption: str, ranges: Iterable[AngleRange], joints: Iterable[Row]) -> DataTable:
    """Percentiles of every angle, degrees; beside them the range about the joint's axis in calibration."""
    header = (
        "Joint",
        "Angle",
        "Min [deg]",
        "5 % [deg]",
        "Median [deg]",
        "95 % [deg]",
        "Max [deg]",
        "5 to 95 % [deg]",
        "Frames",
        "Calibration, about the joint’s axis [deg]",
    )
    calibrated = {row["joint"]: row["range_deg"] for row in joints}
    rows = tuple(
        (
            own.joint,
            own.angle,
            *(number(value, 1) for value in own.at_deg),
            number(own.at_deg[3] - own.at_deg[1], 1),
            str(own.n_frames),
            number(calibrated.get(own.joint), 1),
        )
        for own in ranges
    )
    return DataTable(caption, (Block(header, rows),), (), frozenset({0, 1}))


def evidence_table(caption: str, model: ModelResults) -> DataTable:
    """What the calibration says of each joint: its gap, its error and its system's singular values."""
    header = (
        "Joint",
        "Status",
        "Gap rms [mm]",
        "Free gap rms [mm]",
        "SD of the centre [mm]",
        "Frames",
        "Independent samples",
        *(f"Singular value {n}" for n in range(1, 7)),
        "Message",
    )
    values_of = {row["joint"]: row["singular_values"] for row in model.solutions}
    rows = tuple(_evidence_cells(row, values_of.get(row["joint"])) for row in model.joints)
    return DataTable(caption, (Block(header, rows),), (), frozenset({0, 1, len(header) - 1}))


def _evidence_cells(row: Row, values: list[float] | None) -> tuple[str, ...]:
    return (
        row["joint"],
        STATUS_MARKS.get(str(row["status"]), str(row["status"])),
        number(row["gap_rms_mm"]),
        number(row["gap_rms_free_mm"]),
        number(row["sd_mm"]),
        str(row["n_frames"]),
        number(row["n_effective"], 1),
        *([number(value, 4) for value in values] if values is not None else [DASH] * 6),
        row["message"],
    )


def _tip_error_cells(row: Row) -> tuple[str, ...]:
    columns = ("mean_mm", "sd_mm", "median_mm", "p95_mm", "max_mm", "min_mm")
    return (
        row["model"],
        row["digit"],
        row["binding"],
        *(number(row[column]) for column in columns),
        str(row["n_frames"]),
        str(row["n_frames_total"]),
        "held out" if row["held_out"] else "○ in-sample",
        row["message"],
    )
