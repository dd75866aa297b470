"""Write a simulated recording as a tidy table in CSV or Parquet, as a laboratory would provide it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from shukotsu.errors import InputError
from shukotsu.simulate.simulation import Simulated
from shukotsu.tables.parquet_files import store_digest
from shukotsu.tables.poses import Poses
from shukotsu.tables.whole_files import replacing

ENDINGS = (".parquet", ".csv")


def check_ending(path: Path) -> None:
    """Raise InputError unless the file name ends in a format that can be written."""
    if path.suffix not in ENDINGS:
        raise InputError(f"{path}: the file's ending determines the format; expected {' or '.join(ENDINGS)}")


def tidy(recording: Simulated | Poses) -> pa.Table:
    """Convert a recording to a tidy table, by frame, segments in the layout's order.

    Parameters
    ----------
    recording : Simulated or Poses
        T frames of S receivers.

    Returns
    -------
    pyarrow.Table
        A row per frame and segment: frame, time_s, segment, x_mm to z_mm, qw to qz.

    """
    n_frames, n_segments = recording.position_mm.shape[:2]
    columns = {
        "frame": pa.array(np.repeat(recording.frame, n_segments)),
        "time_s": pa.array(np.repeat(recording.time_s, n_segments)),
        "segment": pa.array(list(recording.segments) * n_frames, pa.string()),
    }
    for i, axis in enumerate("xyz"):
        columns[f"{axis}_mm"] = pa.array(recording.position_mm[..., i].ravel())
    for i, part in enumerate("wxyz"):
        columns[f"q{part}"] = pa.array(recording.quaternion[..., i].ravel())
    return pa.table(columns)


def write_recording(path: Path, recording: Simulated | Poses) -> None:
    """Write a recording atomically as CSV or Parquet; numbers in CSV have full precision.

    Parameters
    ----------
    path : Path
        File to write; its ending determines the format.
    recording : Simulated or Poses
        Recording to write.

    Raises
    ------
    InputError
        If the ending is neither .parquet nor .csv.

    """
    check_ending(path)
    with replacing(path) as temporary:
        if path.suffix == ".csv":
            options = pyarrow.csv.WriteOptions(quoting_style="needed")
            pyarrow.csv.write_csv(tidy(recording), temporary, options)
        else:
            dictionary = ["frame", "time_s", "segment"]
            pq.write_table(
                tidy(recording),
                temporary,
                compression="zstd",
                use_dictionary=dictionary,
                write_page_checksum=True,
            )
            store_digest(temporary)
