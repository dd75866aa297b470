"""Reading recordings of any format, checking refusals, and writing C3D files, for the tests of the
readers.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from shukotsu.errors import InputError
from shukotsu.readers.import_recording import read_parts
from shukotsu.readers.poses_table import PosesTable
from shukotsu.readers.samples import Samples, join_samples
from shukotsu.study.layout import Layout, read_layout
from shukotsu.study.mapping import mapping_from_config

ARM = read_layout("arm")
LIBERTY = read_layout("liberty16")
WHO = ("--layout=liberty16", "--subject=01", "--hand=right", "--task=rom")
"""Options of `import` that identify a recording."""


def read(path: Path, layout: Layout = LIBERTY, mapping: dict[str, Any] | None = None) -> Samples:
    """Read a recording by a mapping's content or, without one, by its file extension."""
    checked = None if mapping is None else mapping_from_config(mapping, "mapping.yaml")
    return join_samples(read_parts(path, layout, checked))


def refuse(path: Path, message: str, layout: Layout = LIBERTY, mapping: dict[str, Any] | None = None) -> None:
    """Check that reading fails with one sentence that contains the message, a text or regular expression."""
    with pytest.raises(InputError) as caught:
        read(path, layout, mapping)
    sentence = str(caught.value)
    assert message in sentence or re.search(message, sentence), sentence
    assert "\n" not in sentence


def write_c3d(path: Path, points: np.ndarray, labels: Sequence[str], first: int = 1) -> Path:
    """Write a C3D file of 50 Hz in mm; points : (T, P, 3), first : number of the first frame."""
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = [*labels]
    file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], -1).transpose(2, 1, 0)
    file["header"]["points"]["first_frame"] = first - 1
    file.write(str(path))
    return path


def of(samples: Samples, segment: str) -> np.ndarray:
    """Return whether each sample is of a segment, (N,)."""
    return samples.segment == samples.segments.index(segment)


def columns_of(table: PosesTable) -> dict[str, Any]:
    """Return the columns of a poses table, with all segments concatenated."""
    groups = list(table.row_groups(1000))
    columns = {name: [group[name] for group in groups] for name in groups[0]}
    return {
        name: np.concatenate(parts)
        if isinstance(parts[0], np.ndarray)
        else pa.concat_arrays([part.cast(pa.string()) for part in parts])
        for name, parts in columns.items()
    }
